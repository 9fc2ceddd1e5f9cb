# SPDX-License-Identifier: GPL-3.0-or-later
"""Check the site that the target `docs` made: test_site.py BUILD_FOLDER

Its addresses are those that site.py promises, each link leads to a file and, in the pages of the guide, to a heading;
the search leads to headings; the live page is the demo's own file; no page names a folder of the machine, or has
Markdown left."""
import filecmp
import html.parser
import json
import os
import re
import sys
import urllib.parse

docs = os.path.join(sys.argv[1], "docs")
site = os.path.join(docs, "site")
faults = []


class Links(html.parser.HTMLParser):
    def __init__(self):
        super().__init__()
        self.found, self.ids, self.text = [], set(), ""
        self.skipped = 0

    def handle_starttag(self, tag, attrs):
        for name, value in attrs:
            if name in ("href", "src", "srcset") and value:
                self.found.append(value)
            if name in ("id", "name") and value:
                self.ids.add(value)
        self.skipped += tag in ("script", "style", "pre", "code")

    def handle_endtag(self, tag):
        self.skipped -= tag in ("script", "style", "pre", "code")

    def handle_data(self, data):
        self.text += "" if self.skipped else data


def parse(path):
    links = Links()
    with open(path, encoding="utf-8") as file:
        links.feed(file.read())
    return links


pages = {}
for folder, _, names in os.walk(site):
    for name in names:
        if name.endswith(".html") and name != "live.html":
            path = os.path.join(folder, name)
            pages[path] = parse(path)
count = 0
for path, page in pages.items():
    own = os.path.relpath(path, site)
    made = not own.startswith("reference" + os.sep)
    for link in page.found:
        if re.match(r"(https?|data|javascript|mailto):", link):
            continue
        name, _, fragment = urllib.parse.unquote(link).partition("#")
        target = os.path.normpath(os.path.join(os.path.dirname(path), name)) if name else path
        count += 1
        if os.path.isdir(target) or not os.path.exists(target) or not target.startswith(site):
            faults.append(f"{own}: no file {link}")
        elif fragment and made and target in pages and fragment not in pages[target].ids:
            faults.append(f"{own}: no heading {link}")
    if made:
        left = re.search(r"\]\(|\*\*|\x00|^\s*#+ |!\[", page.text, re.M)
        if left:
            faults.append(f"{own}: Markdown is left: {page.text[max(0, left.start() - 40):left.end() + 20]!r}")
    with open(path, encoding="utf-8") as file:
        text = file.read()
        if os.path.abspath(sys.argv[1]) in text or (not made and "/tmp" in own + text):
            faults.append(f"{own}: names a folder of this machine")
with open(os.path.join(site, "search.js"), encoding="utf-8") as file:
    sections = json.loads(file.readline()[len("const SECTIONS = "):].rstrip(";\n"))
for address, *_ in sections:
    name, _, heading = address.partition("#")
    if heading not in pages[os.path.join(site, name)].ids:
        faults.append(f"the search leads to {address}, which is not there")
if not any(address.startswith("guide/navigation") and "nodule" in title for address, title, *_ in sections):
    faults.append("the search does not know where a nodule goes")
for address in ("index.html", "live.html", "guide/index.html", "guide/navigation.html", "guide/first-lungs.html",
                "model.html", "accuracy.html", "reference/index.html"):
    if not os.path.exists(os.path.join(site, address)):
        faults.append(f"no page {address}")
if not filecmp.cmp(os.path.join(site, "live.html"), os.path.join(docs, "demo", "lungs.html"), shallow=False):
    faults.append("live.html is not the page of the demo")
print("\n".join(faults) or f"{len(pages)} pages, {count} links")
sys.exit(1 if faults else 0)
