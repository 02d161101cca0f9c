from setuptools import find_packages, setup

package = "midastouch_common"

setup(
    name=package,
    version="0.1.0",
    # Named, although it is the default: editable installs then put this folder on sys.path, ahead of
    # the namespace package that the folder of the same name is when Python runs in the workspace root.
    package_dir={"": "."},
    packages=find_packages(exclude=["test", "test.*"]),
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
        "PyYAML",
        "scipy",
        "trimesh",
    ],
    python_requires=">=3.10",
    maintainer="MidasTouch for ROS 2 maintainers",
    maintainer_email="maintainers@example.org",
    description="Errors, poses, meshes, files, and the base of the nodes: what the packages of MidasTouch share.",
    license="MIT",
    extras_require={"test": ["hypothesis", "pytest"]},
)
