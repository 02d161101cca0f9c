from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

package = "midastouch_bringup"
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
        *(
            (f"share/{package}/{folder}", [str(path) for path in sorted(Path(folder).glob("*.*"))])
            for folder in ("config", "foxglove", "launch", "rviz", "urdf")
        ),
    ],
    install_requires=["digit_driver", "midastouch_common", "midastouch_filter", "midastouch_perception", "PyYAML"],
    python_requires=">=3.10",
    maintainer=manifest.findtext("maintainer"),
    maintainer_email=manifest.find("maintainer").get("email"),
    description=manifest.findtext("description"),
    license=manifest.findtext("license"),
    extras_require={"test": ["pytest"]},
    entry_points={
        "console_scripts": [
            "all_in_one = midastouch_bringup.executables:all_in_one",
            "detection_prior = midastouch_filter.executables:detection_prior",
            "digit_sim = midastouch_simulation.executables:digit_sim",
            "explorer = midastouch_motion.executables:explorer",
            "finger = midastouch_simulation.executables:simulated_finger",
            "midastouch = midastouch_tools.__main__:main",
            "mount_tf = midastouch_motion.executables:mount_tf",
            "recorder = midastouch_tools.executables:recorder",
            "replay = midastouch_tools.executables:replay",
            "ur_tf = midastouch_motion.executables:ur_tf",
        ]
    },
)
