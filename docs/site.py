# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the site: site.py SOURCE_FOLDER DEMO_FOLDER SITE_FOLDER

Addresses stay the same from build to build:

    index.html             README
    live.html              the page lungs.html of the demo, unchanged
    guide/NAME.html        docs/guide/NAME.md
    NAME.html              docs/NAME.md
    search.js              the texts of all pages, and the search
    reference/index.html   the C headers, which doxygen has written there before

Each page has a column of contents: the guide in the order of its table, then other pages; and a search through all
pages, whose index is search.js. cmark-gfm reads the Markdown. Links to files of the repository that are not on the site
become plain text."""
import html
import json
import os
import posixpath
import re
import shutil
import subprocess
import sys

source, demo, site = sys.argv[1:4]
OTHERS = ["model", "accuracy", "paper", "trust", "inputs", "compare", "promises", "platforms"]

STYLE = """
:root { color-scheme: light dark;
  --ink: #121d2b; --soft: #4b596b; --line: #d5dce6; --ground: #fff; --code: #f1f4f8; --link: #0e6370; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #edf2f7; --soft: #a6b4c4; --line: #2c3947; --ground: #0d1219; --code: #18212c; --link: #6fd0dd; }
}
* { box-sizing: border-box; }
body { margin: 0; color: var(--ink); background: var(--ground);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
a { color: var(--link); }
#page { display: grid; grid-template-columns: 260px minmax(0, 760px); gap: 0 48px;
  max-width: 1160px; margin: 0 auto; padding: 24px; }
nav { position: sticky; top: 24px; align-self: start; max-height: calc(100vh - 48px);
  overflow-y: auto; font-size: 14px; }
nav strong { display: block; margin: 14px 0 4px; }
nav ul { margin: 0; padding: 0; list-style: none; }
nav li a { display: block; padding: 3px 8px; border-radius: 6px; color: var(--soft); text-decoration: none; }
nav li a:hover { text-decoration: underline; }
nav li a[aria-current] { color: var(--ink); background: var(--code); font-weight: 600; }
main { min-width: 0; overflow-wrap: anywhere; }
h1 { line-height: 1.2; margin-top: 0; }
img { max-width: 100%; height: auto; border-radius: 8px; }
pre { overflow-x: auto; padding: 12px 14px; border-radius: 8px; background: var(--code);
  font-size: 13.5px; line-height: 1.45; }
code { font-family: ui-monospace, "DejaVu Sans Mono", monospace; font-size: 0.9em;
  background: var(--code); border-radius: 4px; padding: 1px 4px; }
pre code { padding: 0; background: none; font-size: inherit; }
.table { overflow-x: auto; }
table { border-collapse: collapse; font-size: 14.5px; }
th, td { padding: 6px 12px 6px 0; border-bottom: 1px solid var(--line); text-align: left;
  vertical-align: top; overflow-wrap: normal; }
#search { width: 100%; padding: 6px 10px; border: 1px solid var(--soft); border-radius: 6px; font: inherit; }
#found li { margin: 8px 0; }
#found small { display: block; padding: 0 8px; color: var(--soft); }
summary { padding: 6px 0; font-weight: 600; cursor: pointer; }
.live a { display: inline-block; padding: 8px 16px; border-radius: 8px; background: var(--link); color: var(--ground);
  font-weight: 600; text-decoration: none; }
@media (min-width: 821px) { summary { display: none; } }
@media (max-width: 820px) {
  #page { display: block; padding: 16px; }
  nav { position: static; max-height: none; margin-bottom: 24px; border-bottom: 1px solid var(--line); }
}
@media print { nav { display: none; } #page { display: block; } }
"""


def read(name):
    with open(os.path.join(source, name), encoding="utf-8") as file:
        return file.read()


def address(path):
    """Return the address on the site of a file of the repository; None if it is not there."""
    if path == "docs/live.md":
        return "live.html"
    if path == "README.md":
        return "index.html"
    found = re.fullmatch(r"docs/(guide/)?([\w-]+)\.md", path)
    if found:
        return (found[1] or "") + ("index" if found[1] and found[2] == "README" else found[2]) + ".html"
    if re.fullmatch(r"docs/(guide/)?[\w-]+\.(png|webp)|docs/guide/[\w-]+\.py", path):
        return path[len("docs/"):]
    return None


def plain(made):
    return " ".join(html.unescape(re.sub("<[^>]*>", " ", made)).split())


def slug(heading):
    """Return the id of a heading, as GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", html.unescape(re.sub("<[^>]*>", "", heading)).lower()).strip().replace(" ", "-")


class Page:
    """A page of Markdown, as HTML with links relative to its address."""

    def __init__(self, path):
        self.path, self.address = path, address(path)
        text = re.sub(r"^\[!\[.*$\n?", "", read(path), flags=re.M)  # badges are about the repository
        self.title = re.search(r"^# (.*)$", text, re.M)[1].replace("`", "")
        made = subprocess.run(["cmark-gfm", "--unsafe", "-e", "table"], input=text, capture_output=True, text=True,
                              check=True).stdout
        made = re.sub(r'<a href="([^"]*)"( title="[^"]*")?>(.*?)</a>', self.anchor, made, flags=re.S)
        made = re.sub(r'\b(src|srcset)="([^"]+)"',
                      lambda found: f'{found[1]}="{self.link(found[2]) or found[2]}"', made)
        made = re.sub(r"<(h\d)>(.*?)</h\d>",
                      lambda found: f'<{found[1]} id="{slug(found[2])}">{found[2]}</{found[1]}>', made)
        self.body = made.replace("<table>", '<div class="table"><table>').replace("</table>", "</table></div>")

    def link(self, target):
        """Return the relative address of a link's target; None if it is not on the site."""
        if re.match(r"https?:|#|mailto:", target):
            return target
        path, _, fragment = target.partition("#")
        at = address(posixpath.normpath(posixpath.join(posixpath.dirname(self.path), path)))
        return at and self.relative(at) + ("#" + fragment if fragment else "")

    def anchor(self, found):
        at = self.link(html.unescape(found[1]))
        return found[3] if at is None else f'<a href="{html.escape(at)}">{found[3]}</a>'

    def relative(self, at):
        return posixpath.relpath(at, posixpath.dirname(self.address) or ".")

    def sections(self):
        """Yield the address, the heading and the text of each section, for the search."""
        parts = re.split(r'<h\d id="([^"]*)">(.*?)</h\d>', self.body)
        for at, heading, text in zip(parts[1::3], parts[2::3], parts[3::3]):
            yield [f"{self.address}#{at}", self.title, plain(heading), plain(text)]

    def write(self, contents):
        menu = ""
        for heading, entries in contents:
            links = "".join(f'<li><a href="{self.relative(at)}"{" aria-current=page" if at == self.address else ""}>'
                            f'{html.escape(title)}</a></li>'
                            for at, title in entries)
            menu += f"<strong>{heading}</strong><ul>{links}</ul>"
        title = self.title if self.title == "Supine" else f"{self.title} - Supine"
        live = f'<p class="live"><a href="{self.relative("live.html")}">Turn the lungs yourself</a></p>'
        body = re.sub("</h1>", lambda _: "</h1>\n" + live, self.body, count=1) if self.title == "Supine" else self.body
        root = posixpath.relpath(".", posixpath.dirname(self.address) or ".")
        page = (f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
                f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
                f'<title>{html.escape(title)}</title>\n<link rel="icon" href="data:,">\n<style>{STYLE}</style>\n'
                f'</head>\n<body>\n<div id="page">\n<nav aria-label="Contents">\n'
                f'<input id="search" type="search" placeholder="Search" aria-label="Search" hidden>\n'
                f'<ul id="found" aria-live="polite"></ul>\n'
                f'<details open><summary>Contents</summary>{menu}</details>\n</nav>\n<main>\n{body}\n</main>\n'
                f'</div>\n<script>const ROOT = {json.dumps(root + "/")};</script>\n'
                f'<script src="{self.relative("search.js")}"></script>\n</body>\n</html>\n')
        path = os.path.join(site, self.address)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w", encoding="utf-8") as file:
            file.write(page)


def main():
    order = re.findall(r"\]\(([\w-]+)\.md\)", read("docs/guide/README.md"))
    present = {name[:-3] for name in os.listdir(os.path.join(source, "docs/guide"))
               if name.endswith(".md")} - {"README"}
    if set(order) != present:
        sys.exit(f"docs/guide/README.md does not list each page once: {sorted(set(order) ^ present)}")
    pages = [Page("README.md"), Page("docs/guide/README.md")] + [Page(f"docs/guide/{name}.md") for name in order] + \
        [Page(f"docs/{name}.md") for name in OTHERS]
    contents = [("Supine", [("index.html", "Overview"), ("live.html", "Live page")]),
                ("Guide", [(page.address, page.title) for page in pages if page.address.startswith("guide/")]),
                ("Reference", [(page.address, page.title) for page in pages[-len(OTHERS):]] +
                 [("reference/index.html", "C headers")])]
    for page in pages:
        page.write(contents)
    sections = [section for page in pages for section in page.sections()]
    with open(os.path.join(site, "search.js"), "w", encoding="utf-8") as file:
        file.write(f"const SECTIONS = {json.dumps(sections, ensure_ascii=False)};\n{read('docs/search.js')}")
    for folder in ("docs", "docs/guide"):
        for name in os.listdir(os.path.join(source, folder)):
            at = address(f"{folder}/{name}")
            if at and not at.endswith(".html"):
                shutil.copy(os.path.join(source, folder, name), os.path.join(site, at))
    shutil.copy(os.path.join(demo, "lungs.html"), os.path.join(site, "live.html"))
    print(f"open {site}/index.html")


main()
