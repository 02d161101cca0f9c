from xml.etree import ElementTree

from setuptools import find_packages, setup

package = "midastouch_tools"
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
        ("bin", ["scripts/midastouch"]),
    ],
    install_requires=[
        "digit_driver",
        "matplotlib",
        "mcap",
        "midastouch_bringup",
        "midastouch_common",
        "midastouch_filter",
        "midastouch_kernels",
        "midastouch_motion",
        "midastouch_perception",
        "midastouch_simulation",
        "numpy",
        "opencv-contrib-python-headless",
        "pillow",
        "PyYAML",
        "rosbags",
        "scipy",
        "tqdm",
    ],
    python_requires=">=3.10",
    maintainer=manifest.findtext("maintainer"),
    maintainer_email=manifest.find("maintainer").get("email"),
    description=manifest.findtext("description"),
    license=manifest.findtext("license"),
    extras_require={
        "export": ["h5py", "pyarrow"],
        "open3d": ["libusb-package", "open3d-cpu>=0.19"],
        "test": ["pytest"],
        "ur": ["midastouch_motion[ur]"],
        "view": ["rerun-sdk>=0.39,<0.42"],
    },
    entry_points={
        "console_scripts": [
            "midastouch = midastouch_tools.__main__:main",
            "recorder = midastouch_tools.executables:recorder",
            "replay = midastouch_tools.executables:replay",
        ]
    },
)
