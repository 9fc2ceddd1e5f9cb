# SPDX-License-Identifier: GPL-3.0-or-later
"""Write what the files of a release contain and depend on, as SPDX 2.3 and CycloneDX 1.5:

    sbom.py FOLDER VERSION COMMIT UNPACKED PACKAGES

FOLDER has the files of the release and receives supine-VERSION-binaries.spdx.json and .cdx.json. UNPACKED is the folder
of the relocatable archive. PACKAGES has a line `FILE PACKAGE` for each library in its folder lib. Runs in the sources,
after build/package was built. Libraries are taken from the files themselves: what ELF files need, what the build links
from archives, what the packages' metadata ask for. Versions and licences are those of Debian's packages on this system.
SOURCE_DATE_EPOCH is the only time in the documents."""
import email
import functools
import hashlib
import json
import os
import re
import subprocess
import sys
import tarfile
import time
import uuid
import zipfile
from urllib.parse import quote

GLIBC = re.compile(r"(lib(c|m|dl|rt|pthread|resolv)|ld-linux.*)\.so\.\d+")
XXHASH = "libxxhash-dev"  # a header with the whole implementation
WASM = ["wasi-libc", "libclang-rt-14-dev-wasm32"]  # linked into supine.wasm, which runtime/js holds as text


def output(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


@functools.cache
def queried(package):
    """Return version, source package and processor of an installed Debian package; None if it is not installed."""
    form = "${Version}\t${source:Package} ${source:Version}\t${Architecture}\n"
    done = subprocess.run(["dpkg-query", "-W", "-f", form, package], capture_output=True, text=True, check=False)
    return done.stdout.splitlines()[0].split("\t") if done.returncode == 0 else None


@functools.cache
def sha256(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


class Bill:
    """Components by their identifier, and relations between them."""

    def __init__(self):
        self.components, self.relations, self.texts = {}, [], {}

    def add(self, key, **fields):
        key = re.sub(r"[^A-Za-z0-9.]+", "-", key)
        self.components.setdefault(key, fields)
        return key

    def relate(self, one, kind, other):
        if (one, kind, other) not in self.relations:
            self.relations.append((one, kind, other))

    def debian(self, package, path=None):
        """Add a Debian package, or the one file of it that is shipped; return its identifier. A package that is not
        installed, as its part of the release was built elsewhere, has no version."""
        key, purl = os.path.basename(path) if path else f"debian-{package}", f"pkg:deb/debian/{quote(package)}"
        found = queried(package)
        if found is None:
            return self.add(key, name=package, purl=f"{purl}?distro=debian-12")
        with open(f"/usr/share/doc/{package}/copyright", encoding="utf-8", errors="replace") as file:
            self.texts[package] = file.read()
        return self.add(key, name=package, version=found[0], source=found[1], debian=package, path=path,
                        file=path and os.path.relpath(path, unpacked),
                        purl=f"{purl}@{quote(found[0])}?arch={found[2]}&distro=debian-12")


def licences(text):
    """Return the names of licences in a copyright file of Debian, if programs can read it."""
    named = re.findall(r"^License: *(\S.*?) *$", text, re.M) if text.startswith("Format:") else []
    return sorted(set(named)) or ["see Debian's copyright file"]


def needs(path):
    """Return the names of the libraries that an ELF file needs."""
    return re.findall(r"\(NEEDED\).*\[(.*)\]", output("readelf", "-dW", path))


def link(bill, one, path, shipped):
    """Relate an ELF file to the libraries that it needs: shipped ones, and those of glibc."""
    for name in needs(path):
        if not (name in shipped or GLIBC.fullmatch(name)):
            sys.exit(f"sbom.py: {path} needs {name}, which the archive lacks")
        bill.relate(one, "DEPENDS_ON", shipped.get(name) or bill.debian("libc6"))


def add_static(bill, one, names):
    for name in names:
        bill.relate(one, "STATIC_LINK", bill.debian(name))


def add_archive(bill, one, static):
    shipped = {}
    with open(packages, encoding="utf-8") as file:
        for name, package in map(str.split, file):
            shipped[name] = bill.debian(package, os.path.join(unpacked, "lib", name))
            bill.relate(one, "CONTAINS", shipped[name])
    missing = set(os.listdir(os.path.join(unpacked, "lib"))) - set(shipped)
    if missing:
        sys.exit(f"sbom.py: no package of {sorted(missing)}")
    link(bill, one, os.path.join(unpacked, "bin/supine"), shipped)
    for name, key in shipped.items():
        link(bill, key, os.path.join(unpacked, "lib", name), shipped)
    add_static(bill, one, static)


def add_deb(bill, one, path, static):
    depends = output("dpkg-deb", "-f", path, "Depends")
    for package in re.findall(r"(?:^|, )([a-z0-9.+-]+)", depends):
        bill.relate(one, "DEPENDS_ON", bill.debian(package))
    add_static(bill, one, static)


def add_wheel(bill, one, path):
    """Return the licence that a wheel states."""
    with zipfile.ZipFile(path) as wheel:
        name = next(name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
        metadata = email.message_from_bytes(wheel.read(name))
    for needed in metadata.get_all("Requires-Dist", []):
        name = re.match(r"[\w.-]+", needed)[0]
        bill.relate(one, "DEPENDS_ON", bill.add(f"pypi-{name}", name=name, purl=f"pkg:pypi/{name}"))
    bill.relate(one, "DEPENDS_ON", bill.debian("libc6"))
    add_static(bill, one, [XXHASH])
    return metadata["License"]


def add_npm(bill, one, path):
    """Return the licence that an npm package states."""
    with tarfile.open(path) as package:
        metadata = json.load(package.extractfile("package/package.json"))
    for name in metadata.get("dependencies", {}):
        bill.relate(one, "DEPENDS_ON", bill.add(f"npm-{name}", name=name, purl=f"pkg:npm/{name}"))
    add_static(bill, one, [XXHASH, *WASM])
    return metadata["license"]


def collect():
    """Return the bill of the release's files, and the identifiers of these."""
    bill, made = Bill(), []
    with open("build/package/build.ninja", encoding="utf-8") as file:
        archives = set(re.findall(r"(/usr/\S+\.a)\b", file.read()))
    static = sorted(output("dpkg", "-S", path).split(":")[0] for path in archives) + [XXHASH, *WASM]
    everything = " AND ".join(sorted(name[:-4] for name in os.listdir("LICENSES")))
    for name in sorted(os.listdir(folder)):
        path = os.path.join(folder, name)
        if not re.search(r"\.(deb|whl|tgz|tar\.gz)$", name):
            continue
        one = bill.add(name, name=name, version=version, file=name, path=path, licence=everything)
        made.append(one)
        if name.endswith(".deb"):
            add_deb(bill, one, path, static)
        elif name.endswith(".whl"):
            bill.components[one]["licence"] = add_wheel(bill, one, path)
        elif name.endswith(".tgz"):
            bill.components[one]["licence"] = add_npm(bill, one, path)
        elif "-linux-" in name:
            add_archive(bill, one, static)
    return bill, made


def spdx(bill, made):
    def package(key, c):
        row = {"SPDXID": f"SPDXRef-{key}", "name": c["name"], "downloadLocation": "NOASSERTION", "filesAnalyzed": False,
               "licenseConcluded": "NOASSERTION", "copyrightText": "NOASSERTION",
               "licenseDeclared": c.get("licence") or (reference(c["debian"]) if "debian" in c else "NOASSERTION")}
        if "version" in c:
            row["versionInfo"] = c["version"]
        if "source" in c:
            row |= {"supplier": "Organization: Debian", "sourceInfo": f"built from the source package {c['source']}"}
        if c.get("file"):
            row |= {"packageFileName": c["file"],
                    "checksums": [{"algorithm": "SHA256", "checksumValue": sha256(c["path"])}]}
        if "purl" in c:
            row["externalRefs"] = [{"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl",
                                    "referenceLocator": c["purl"]}]
        return row

    def reference(name):
        return "LicenseRef-Debian-" + name.replace("+", "-plus")

    relation = lambda one, kind, other: {"spdxElementId": f"SPDXRef-{one}", "relationshipType": kind,
                                         "relatedSpdxElement": f"SPDXRef-{other}"}
    return {"spdxVersion": "SPDX-2.3", "dataLicense": "CC0-1.0", "SPDXID": "SPDXRef-DOCUMENT",
            "name": f"supine-{version}-binaries",
            "documentNamespace": f"http://spdx.org/spdxdocs/supine-{version}-binaries-{commit}",
            "creationInfo": {"created": moment, "creators": [f"Tool: supine-sbom-{version}"]},
            "packages": [package(key, c) for key, c in bill.components.items()],
            "relationships": [relation("DOCUMENT", "DESCRIBES", key) for key in made] +
                             [relation(*row) for row in bill.relations],
            "hasExtractedLicensingInfos": [
                {"licenseId": reference(name), "name": f"Debian's copyright file of {name}", "extractedText": text}
                for name, text in sorted(bill.texts.items())]}


def cyclonedx(bill, made):
    def component(key, c):
        kind = "application" if key in made else "library"
        row = {"type": kind, "bom-ref": key, "name": c["name"]}
        if "version" in c:
            row["version"] = c["version"]
        if c.get("file"):
            row["hashes"] = [{"alg": "SHA-256", "content": sha256(c["path"])}]
        if "licence" in c:
            row["licenses"] = [{"expression": c["licence"]}]
        elif "debian" in c:
            row["licenses"] = [{"license": {"name": name}} for name in licences(bill.texts[c["debian"]])]
        if "purl" in c:
            row["purl"] = c["purl"]
        row["properties"] = [{"name": f"supine:{name}", "value": c[name]} for name in ("file", "source") if c.get(name)]
        return row

    needed = lambda key: list(dict.fromkeys(other for one, _, other in bill.relations if one == key))
    serial = uuid.uuid5(uuid.NAMESPACE_URL, f"http://spdx.org/spdxdocs/supine-{version}-binaries-{commit}")
    return {"bomFormat": "CycloneDX", "specVersion": "1.5", "serialNumber": f"urn:uuid:{serial}", "version": 1,
            "metadata": {"timestamp": moment,
                         "component": {"type": "application", "bom-ref": "supine", "name": "supine",
                                       "version": version}},
            "components": [component(key, c) for key, c in bill.components.items()],
            "dependencies": [{"ref": "supine", "dependsOn": made}] +
                            [{"ref": key, "dependsOn": needed(key)} for key in bill.components]}


folder, version, commit, unpacked, packages = sys.argv[1:]
moment = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(int(os.environ["SOURCE_DATE_EPOCH"])))
contents = collect()
for ending, document in (("spdx", spdx), ("cdx", cyclonedx)):
    with open(os.path.join(folder, f"supine-{version}-binaries.{ending}.json"), "w", encoding="utf-8") as out:
        json.dump(document(*contents), out, indent=1, ensure_ascii=False)
        out.write("\n")
