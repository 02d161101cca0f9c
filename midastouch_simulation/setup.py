from xml.etree import ElementTree

from setuptools import find_packages, setup

package = "midastouch_simulation"
manifest = ElementTree.parse("package.xml")

setup(
    name=package,
    version=manifest.findtext("version"),
    # Named, although it is the default: editable installs then put this folder on sys.path, ahead of
    # the namespace package that the folder of the same name is when Python runs in the workspace root.
    package_dir={"": "."},
    packages=find_packages(exclude=["test", "test.*"]),
    package_data={package: ["**/*.json", "py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package}"]),
        (f"share/{package}", ["package.xml"]),
    ],
    install_requires=[
        "digit_driver",
        "matplotlib",
        "midastouch_common",
        "midastouch_kernels",
        "midastouch_motion",
        "midastouch_perception",
        "numpy",
        "opencv-contrib-python-headless",
        "scipy",
    ],
    python_requires=">=3.10",
    maintainer=manifest.findtext("maintainer"),
    maintainer_email=manifest.find("maintainer").get("email"),
    description=manifest.findtext("description"),
    license=manifest.findtext("license"),
    extras_require={
        "mujoco": ["mujoco>=3.2"],
        "test": ["hypothesis", "pytest"],
        "train": ["onnx", "onnxscript", "safetensors", "torch>=2.6"],
    },
    entry_points={
        "console_scripts": [
            "digit_sim = midastouch_simulation.executables:digit_sim",
            "finger = midastouch_simulation.executables:simulated_finger",
            "mujoco_arm = midastouch_simulation.executables:mujoco_arm",
            "simulated_finger = midastouch_simulation.executables:simulated_finger",
            "simulated_gripper = midastouch_simulation.executables:simulated_gripper",
        ]
    },
)
