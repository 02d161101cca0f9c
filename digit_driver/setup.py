from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

package = "digit_driver"
manifest = ElementTree.parse("package.xml")

setup(
    name=package,
    version=manifest.findtext("version"),
    # Named, although it is the default: editable installs then put this folder on sys.path, ahead of
    # the namespace package that the folder of the same name is when Python runs in the workspace root.
    package_dir={"": "."},
    packages=find_packages(exclude=["test", "test.*"]),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package}"]),
        (f"share/{package}", ["package.xml"]),
        *(
            (f"share/{package}/{folder}", [str(path) for path in sorted(Path(folder).glob("*.*"))])
            for folder in ("config", "launch", "udev")
        ),
    ],
    install_requires=["midastouch_common", "numpy", "opencv-contrib-python-headless", "PyYAML"],
    package_data={package: ["cameras/*.yaml", "py.typed"]},
    python_requires=">=3.10",
    maintainer=manifest.findtext("maintainer"),
    maintainer_email=manifest.find("maintainer").get("email"),
    description=manifest.findtext("description"),
    license=manifest.findtext("license"),
    extras_require={"test": ["pytest"]},
    entry_points={"console_scripts": ["digit_driver = digit_driver.executables:digit_driver"]},
)
