# SPDX-License-Identifier: GPL-3.0-or-later
"""Say which names of subjects are names of folders that stay in the folder of the results."""
import re

RESERVED = ("", ".", "..", "group.csv", "group.html")  # results of the group lie beside the folders of the subjects


def fault(name):
    """Return what is wrong with the name of a subject, or None."""
    if name is None or name in RESERVED or re.search(r"[/\\{}\x00-\x1f]", name) or name.startswith("-"):
        return (f"'{name}' cannot be the name of a subject, as it names the folder of its results: "
                "use letters, digits and - . _ +, and no / or \\")
    return None
