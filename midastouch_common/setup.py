from xml.etree import ElementTree

from setuptools import find_packages, setup

package = "midastouch_common"
manifest = ElementTree.parse("package.xml")

setup(
    name=package,
    version=manifest.findtext("version"),
    # Named, although it is the default: editable installs then put this folder on sys.path, ahead of
    # the namespace package that the folder of the same name is when Python runs in the workspace root.
    package_dir={"": "."},
    packages=find_packages(exclude=["test", "test.*"]),
    package_data={package: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package}"]),
        (f"share/{package}", ["package.xml"]),
    ],
    install_requires=[
        "libigl",
        "midastouch_kernels",
        "numpy",
        "opencv-contrib-python-headless",
        "pykdtree",
        "simplejpeg",
        "PyYAML",
        "scipy",
        "trimesh",
    ],
    python_requires=">=3.10",
    maintainer=manifest.findtext("maintainer"),
    maintainer_email=manifest.find("maintainer").get("email"),
    description=manifest.findtext("description"),
    license=manifest.findtext("license"),
    extras_require={"test": ["hypothesis", "pytest"]},
)
