# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the site: site.py SOURCE_FOLDER DEMO_FOLDER SITE_FOLDER

Addresses stay the same from build to build:

    index.html             README
    live.html              the page lungs.html of the demo, unchanged
    guide/NAME.html        docs/guide/NAME.md
    NAME.html              docs/NAME.md
    reference/index.html   the C headers, which doxygen has written there before

Each page has a column of contents: the guide in the order of its table, then other pages. Only the Markdown that the
pages use is known: headings, paragraphs, lists, tables, code, links, pictures, bold and italic type. Links to files of
the repository that are not on the site become plain text."""
import html
import os
import posixpath
import re
import shutil
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


class Page:
    """A page of Markdown, as HTML with links relative to its address."""

    def __init__(self, path):
        self.path, self.address = path, address(path)
        self.ids = set()
        text = re.sub(r"^\[!\[.*$\n?", "", read(path), flags=re.M)  # badges are about the repository
        self.title = re.search(r"^# (.*)$", text, re.M)[1]
        self.body = self.blocks(text.split("\n"))

    def link(self, target):
        """Return the relative address of a link's target; None if it is not on the site."""
        if re.match(r"https?:|#|mailto:", target):
            return target
        path, _, fragment = target.partition("#")
        at = address(posixpath.normpath(posixpath.join(posixpath.dirname(self.path), path)))
        return at and self.relative(at) + ("#" + fragment if fragment else "")

    def relative(self, at):
        return posixpath.relpath(at, posixpath.dirname(self.address) or ".")

    def spans(self, text):
        """Return a line of Markdown as HTML."""
        codes = []

        def keep(made):
            codes.append(made)
            return f"\x00{len(codes) - 1}\x00"

        def anchor(found):
            at = self.link(found[2])
            return found[1] if at is None else keep(f'<a href="{html.escape(at)}">') + found[1] + keep("</a>")

        text = re.sub(r"`` ?(.+?) ?``|`([^`]+)`",
                      lambda found: keep(f"<code>{html.escape(found[1] or found[2])}</code>"), text)
        text = re.sub(r"!\[([^]]*)\]\(([^)]+)\)", lambda found: keep(
            f'<img src="{html.escape(self.link(found[2]) or found[2])}" alt="{html.escape(found[1])}">'), text)
        text = re.sub(r"\[([^]]*)\]\(([^)]+)\)", anchor, text)
        text = html.escape(text, quote=False)
        text = re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", text)
        text = re.sub(r"(?<![\w*])\*([^*\s][^*]*)\*(?![\w*])", r"<em>\1</em>", text)
        while "\x00" in text:
            text = re.sub("\x00(\\d+)\x00", lambda found: codes[int(found[1])], text)
        return text

    def heading(self, line):
        level, text = re.match(r"(#+) (.*)", line).groups()
        made = re.sub(r"[^\w\- ]", "", re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", text.lower())).strip().replace(" ", "-")
        self.ids.add(made)
        return f'<h{len(level)} id="{made}">{self.spans(text)}</h{len(level)}>'

    def table(self, lines):
        rows = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip().strip("|"))] for line in lines]
        made = []
        for i, row in enumerate(rows):
            if i != 1:  # the line below the heading
                tag = "td" if i else "th"
                made.append("<tr>" + "".join(f"<{tag}>{self.spans(cell)}</{tag}>" for cell in row) + "</tr>")
        return '<div class="table"><table>' + "\n".join(made) + "</table></div>"

    def items(self, lines):
        """Return a list. A line that begins neither an item nor a list inside continues the item."""
        found = []
        for line in lines:
            begin = re.match(r"( *)(?:[-*]|\d+\.) +(.*)", line)
            if begin and not begin[1]:
                found.append([begin[2], []])
            elif begin or found[-1][1]:
                found[-1][1].append(re.sub("^ {1,3}", "", line))
            else:
                found[-1][0] += " " + line.strip()
        tag = "ol" if re.match(r"\d", lines[0]) else "ul"
        inner = (f"<li>{self.spans(text)}{self.items(below) if below else ''}</li>" for text, below in found)
        return f"<{tag}>" + "\n".join(inner) + f"</{tag}>"

    def blocks(self, lines):
        made = []
        i = 0

        def take(belongs):
            nonlocal i
            begin = i
            while i < len(lines) and belongs(lines[i]):
                i += 1
            return lines[begin:i]

        while i < len(lines):
            line = lines[i]
            if not line.strip():
                i += 1
            elif line.startswith("```"):
                i += 1
                made.append("<pre><code>" + html.escape("\n".join(take(lambda at: not at.startswith("```"))),
                                                        quote=False) + "</code></pre>")
                i += 1
            elif line.startswith("#"):
                made.append(self.heading(line))
                i += 1
            elif line.startswith("|"):
                made.append(self.table(take(lambda at: at.startswith("|"))))
            elif line.startswith("    "):
                code = "\n".join(at[4:] for at in take(lambda at: at.startswith("    ") or not at.strip()))
                made.append("<pre><code>" + html.escape(code.rstrip(), quote=False) + "</code></pre>")
            elif line.startswith("<"):
                raw = "\n".join(take(lambda at: bool(at.strip())))
                made.append(re.sub(r'(src|srcset)="([^"]+)"',
                                   lambda found: f'{found[1]}="{self.link(found[2]) or found[2]}"', raw))
            elif re.match(r"([-*]|\d+\.) ", line):
                made.append(self.items(take(lambda at: bool(at.strip()))))
            else:
                made.append("<p>" + self.spans(" ".join(at.strip() for at in take(
                    lambda at: bool(at.strip()) and not re.match(r"```|#|\||([-*]|\d+\.) ", at)))) + "</p>")
        return "\n".join(made)

    def write(self, contents):
        menu = ""
        for heading, entries in contents:
            links = "".join(f'<li><a href="{self.relative(at)}"{" aria-current=page" if at == self.address else ""}>'
                            f'{html.escape(title)}</a></li>'
                            for at, title in entries)
            menu += f"<strong>{heading}</strong><ul>{links}</ul>"
        title = self.title if self.title == "Supine" else f"{self.title} - Supine"
        page = (f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
                f'<meta name="viewport" content="width=device-width, '
                f'initial-scale=1">\n<title>{html.escape(title)}</title>\n'
                f'<link rel="icon" href="data:,">\n<style>{STYLE}</style>\n</head>\n<body>\n<div id="page">\n'
                f'<nav aria-label="Contents">{menu}</nav>\n<main>\n{self.body}\n</main>\n</div>\n</body>\n</html>\n')
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
    for folder in ("docs", "docs/guide"):
        for name in os.listdir(os.path.join(source, folder)):
            at = address(f"{folder}/{name}")
            if at and not at.endswith(".html"):
                shutil.copy(os.path.join(source, folder, name), os.path.join(site, at))
    shutil.copy(os.path.join(demo, "lungs.html"), os.path.join(site, "live.html"))
    print(f"open {site}/index.html")


main()
