from xml.etree import ElementTree

from setuptools import find_packages, setup

package = "midastouch_motion"
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
        "midastouch_common",
        "midastouch_filter",
        "midastouch_perception",
        "numpy",
        "scipy",
    ],
    python_requires=">=3.10",
    maintainer=manifest.findtext("maintainer"),
    maintainer_email=manifest.find("maintainer").get("email"),
    description=manifest.findtext("description"),
    license=manifest.findtext("license"),
    extras_require={"test": ["pytest"], "ur": ["ur-rtde"]},
    entry_points={
        "console_scripts": [
            "explorer = midastouch_motion.executables:explorer",
            "mount_tf = midastouch_motion.executables:mount_tf",
            "contact_controller = midastouch_motion.executables:contact_controller",
            "slider = midastouch_motion.executables:contact_controller",
            "ur_speed = midastouch_motion.executables:ur_speed",
            "ur_tf = midastouch_motion.executables:ur_tf",
        ]
    },
)
