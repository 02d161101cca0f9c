from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

package = "midastouch_perception"
manifest = ElementTree.parse("package.xml")

setup(
    name=package,
    version=manifest.findtext("version"),
    # Named, although it is the default: editable installs then put this folder on sys.path, ahead of
    # the namespace package that the folder of the same name is when Python runs in the workspace root.
    package_dir={"": "."},
    packages=find_packages(exclude=["test", "test.*"]),
    package_data={
        package: [
            "py.typed",
            *(f"**/*.{suffix}" for suffix in ("jpg", "json", "npz", "onnx", "ply", "png", "safetensors", "yaml")),
        ]
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package}"]),
        (f"share/{package}", ["package.xml"]),
        # for package://: RViz and other programs read the meshes there
        (f"share/{package}/{package}/objects", [str(path) for path in sorted(Path(package, "objects").glob("*.ply"))]),
    ],
    install_requires=[
        "midastouch_common",
        "midastouch_kernels",
        "numpy",
        "onnxruntime",
        "opencv-contrib-python-headless",
        "pykdtree",
        "scipy",
    ],
    python_requires=">=3.10",
    maintainer=manifest.findtext("maintainer"),
    maintainer_email=manifest.find("maintainer").get("email"),
    description=manifest.findtext("description"),
    license=manifest.findtext("license"),
    extras_require={
        "import": ["onnx"],
        "openvino": ["openvino"],
        "test": ["hypothesis", "pytest"],
        "train": ["safetensors", "torch>=2.6"],
    },
    entry_points={
        "console_scripts": [
            "tdn = midastouch_perception.executables:tdn",
            "tcn = midastouch_perception.executables:tcn",
            "calibrate = midastouch_perception.executables:calibrate",
        ]
    },
)
