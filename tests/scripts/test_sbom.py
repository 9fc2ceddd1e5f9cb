# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare what a release states of its contents with its files: test_sbom.py FOLDER UNPACKED MODULES

FOLDER has the files of the release, UNPACKED the relocatable archive. Every file of the release and every library of
the archive must stand in both documents, once, with its checksum, licence and, if it is Debian's, package and version;
what relations name must exist. The CycloneDX document must be valid for the library of CycloneDX in the folder MODULES
of npm, if it is there."""
import glob
import hashlib
import json
import os
import re
import subprocess
import sys

folder, unpacked, modules = sys.argv[1:]
LIBRARY = "@cyclonedx/cyclonedx-library"
VALIDATE = f"""const {{ Spec, Validation }} = require('{LIBRARY}');
const text = require('fs').readFileSync(0, 'utf8');
new Validation.JsonStrictValidator(Spec.Version.v1dot5).validate(text).then((fault) => {{
  if (fault !== null) throw new Error(JSON.stringify(fault));
}});"""


def read(ending):
    path, = glob.glob(os.path.join(folder, f"*.{ending}.json"))
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def checksum(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


def valid(document):
    """Return whether the library of CycloneDX accepts a document."""
    done = subprocess.run(["node", "-e", VALIDATE], input=json.dumps(document), text=True, capture_output=True,
                          env={**os.environ, "NODE_PATH": modules}, check=False)
    print(done.stderr[:500], end="")
    return done.returncode == 0


spdx, cyclonedx = read("spdx"), read("cdx")
wanted = {name: checksum(os.path.join(folder, name)) for name in os.listdir(folder)
          if re.search(r"\.(deb|whl|tgz|tar\.gz)$", name)}
assert len(wanted) == 6, wanted
libraries = os.listdir(os.path.join(unpacked, "lib"))
assert len(libraries) > 20, libraries
wanted |= {"lib/" + name: checksum(os.path.join(unpacked, "lib", name)) for name in libraries}

stated = [(package["packageFileName"], package["checksums"][0]["checksumValue"]) for package in spdx["packages"]
          if "packageFileName" in package]
assert len(stated) == len(wanted) and dict(stated) == wanted, sorted(set(stated) ^ set(wanted.items()))
files = [(p["value"], c["hashes"][0]["content"]) for c in cyclonedx["components"] for p in c["properties"]
         if p["name"] == "supine:file"]
assert sorted(files) == sorted(stated), "the two documents differ"

texts = {info["licenseId"] for info in spdx["hasExtractedLicensingInfos"]}
for package in spdx["packages"]:
    if package.get("packageFileName", "").startswith("lib/"):
        purl, = [reference["referenceLocator"] for reference in package["externalRefs"]]
        installed = subprocess.run(["dpkg-query", "-W", "-f", "${Version}\n", package["name"]], capture_output=True,
                                   text=True, check=True).stdout.splitlines()[0]
        assert purl.startswith(f"pkg:deb/debian/{package['name'].replace('+', '%2B')}@"), purl
        assert package["versionInfo"] == installed and package["licenseDeclared"] in texts, package
identifiers = {package["SPDXID"] for package in spdx["packages"]} | {"SPDXRef-DOCUMENT"}
named = {relation[end] for relation in spdx["relationships"] for end in ("spdxElementId", "relatedSpdxElement")}
assert named == identifiers, sorted(named ^ identifiers)  # nothing dangles, and nothing stands alone
assert any(package["name"] == "liblapacke-dev" for package in spdx["packages"]), "libraries linked from archives"

if os.path.isdir(os.path.join(modules, LIBRARY)):
    assert valid(cyclonedx), "the CycloneDX document"
    assert not valid({**cyclonedx, "components": [{"name": "without a type"}]}), "everything is valid"
print(f"{len(wanted)} files and libraries, {len(identifiers)} components")
