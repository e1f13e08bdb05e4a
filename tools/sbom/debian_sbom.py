"""A CycloneDX bill of materials of the Debian packages of build/deb. argv: the checkout, the file to write.

The packages with their hashes; what is vendored in them, as components of theirs (JavaScript with the hash that npm
states, wheels with the hash that pip checked); what they depend on, by name: apt chooses the versions.
"""
import base64
import hashlib
import os
import pathlib
import re
import subprocess
import sys
import uuid
from datetime import datetime, timezone
from typing import Dict, Iterable, List

from cyclonedx.model import HashAlgorithm, HashType
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.model.license import DisjunctiveLicense
from cyclonedx.output.json import JsonV1Dot6
from packageurl import PackageURL

LICENCES = {"three": "MIT", "uplot": "MIT", "urdf-loader": "Apache-2.0", "mcap": "MIT", "rosbags": "Apache-2.0"}
PINNED_JAVASCRIPT = re.compile(r"^[A-Z]+=\((\S+) (\S+) (\S+)\)$", re.MULTILINE)
"""Package, version and hash in renew.sh of the panel's vendored libraries."""
PINNED_WHEEL = re.compile(r"^([\w-]+)==(\S+) --hash=sha256:(\S+)$", re.MULTILINE)


def component(kind: str, name: str, version: str, algorithm: HashAlgorithm, digest: str) -> Component:
    """Return a component that is vendored, or a wheel."""
    return Component(type=ComponentType.LIBRARY, name=name, version=version, bom_ref="%s:%s" % (kind, name),
                     purl=PackageURL(kind, None, name, version), hashes=[HashType(alg=algorithm, content=digest)],
                     licenses=[DisjunctiveLicense(id=LICENCES[name])])


def vendored(root: pathlib.Path) -> Dict[str, List[Component]]:
    """Return what is vendored, by the package that has it."""
    libraries = PINNED_JAVASCRIPT.findall((root / "tools/jaka_panel/web/vendor/renew.sh").read_text(encoding="utf-8"))
    wheels = PINNED_WHEEL.findall((root / "tools/debian/package/vendor.txt").read_text(encoding="utf-8"))
    found = {"python3-" + name: [component("pypi", name, version, HashAlgorithm.SHA_256, digest)]
             for name, version, digest in wheels}
    found["jaka-panel"] = [
        component("npm", name, version, HashAlgorithm.SHA_512, base64.b64decode(digest).hex())
        for name, version, digest in libraries]
    folders = {path.name for path in (root / "tools/jaka_panel/web/vendor").iterdir() if path.is_dir()}
    if folders != {name for name, _, _ in libraries} or set(found) != {"jaka-panel", "python3-mcap", "python3-rosbags"}:
        sys.exit("what is vendored is not what is pinned: %s, %s" % (sorted(folders), sorted(found)))
    return found


def field(package: pathlib.Path, name: str) -> str:
    """Return a field of a Debian package."""
    done = subprocess.run(["dpkg-deb", "--field", str(package), name], check=True, stdout=subprocess.PIPE)
    return done.stdout.decode().strip()


def names(relation: str) -> Iterable[str]:
    """Return the names of packages in a field such as Depends; of alternatives the first one."""
    return [part.split("|")[0].split()[0].split(":")[0] for part in relation.split(",") if part.strip()]


def main() -> None:
    """Write the bill."""
    root = pathlib.Path(sys.argv[1])
    inside = vendored(root)
    bom = Bom()
    packages = sorted([*root.glob("build/deb/*.deb"), *root.glob("build/deb/debian-12/*.deb")])
    components: Dict[str, Component] = {}
    for package in packages:
        name = field(package, "Package")
        digest = hashlib.sha256(package.read_bytes()).hexdigest()
        components[name] = Component(
            type=ComponentType.APPLICATION if name == "jaka-panel" else ComponentType.LIBRARY, name=name,
            version=field(package, "Version"), description=field(package, "Description").splitlines()[0],
            purl=PackageURL("deb", "debian", name, field(package, "Version"), {"arch": field(package, "Architecture")}),
            bom_ref="deb:" + name, hashes=[HashType(alg=HashAlgorithm.SHA_256, content=digest)],
            licenses=[DisjunctiveLicense(id=LICENCES.get(name.replace("python3-", ""), "Apache-2.0"))],
            components=inside.pop(name, []))
    if inside:
        sys.exit("no package for what is vendored: %s" % sorted(inside))
    depends = {field(package, "Package"): names(field(package, "Depends")) for package in packages}
    for name in sorted({other for others in depends.values() for other in others} - set(components)):
        components[name] = Component(type=ComponentType.LIBRARY, name=name, bom_ref="deb:" + name,
                                     purl=PackageURL("deb", "debian", name))
    source = Component(type=ComponentType.APPLICATION, name="jaka_ros_driver", bom_ref="jaka_ros_driver",
                       version=components["python3-jaka-ros-driver"].version,
                       licenses=[DisjunctiveLicense(id="Apache-2.0")])
    bom.metadata.component = source
    bom.metadata.timestamp = datetime.fromtimestamp(int(os.environ["SOURCE_DATE_EPOCH"]), timezone.utc)
    bom.serial_number = uuid.uuid5(uuid.NAMESPACE_OID, "".join(
        str(entry.content) for name in sorted(depends) for entry in components[name].hashes))
    bom.components.update(components.values())
    bom.register_dependency(source, [components[name] for name in depends])
    for name, others in depends.items():
        bom.register_dependency(components[name], [components[other] for other in others])
    text = JsonV1Dot6(bom).output_as_string(indent=2)
    pathlib.Path(sys.argv[2]).write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
