"""The mend of the CMake exports in the ROS wheels."""

BROKEN = (
    'INTERFACE_INCLUDE_DIRECTORIES "/opt/python/cp311-cp311/include/python3.11;'
    '/opt/python/cp311-cp311/lib/python3.11/site-packages/numpy/_core/include"\n'
    'INTERFACE_LINK_LIBRARIES "std_msgs::std_msgs"\n'
)
MENDED = (
    'INTERFACE_INCLUDE_DIRECTORIES "${_IMPORT_PREFIX}/include;${_IMPORT_PREFIX}/include"\n'
    'INTERFACE_LINK_LIBRARIES "std_msgs::std_msgs"\n'
)


def test_paths_of_the_build_machine_are_replaced_once(load_tool, tmp_path):
    fix_exports = load_tool("ros_wheels/fix_exports").fix_exports
    folder = tmp_path / "share" / "std_msgs" / "cmake"
    folder.mkdir(parents=True)
    broken = folder / "export_std_msgs__rosidl_generator_pyExport.cmake"
    broken.write_text(BROKEN)
    other = folder / "std_msgsConfig.cmake"
    other.write_text(BROKEN)
    assert fix_exports(tmp_path) == 1
    assert broken.read_text() == MENDED
    assert other.read_text() == BROKEN
    assert fix_exports(tmp_path) == 0
