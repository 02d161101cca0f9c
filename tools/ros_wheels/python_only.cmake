# Included in the project of each message package that the set-up builds: only what Python loads, and fast to compile.
# Nothing loads the C++ messages. The middleware does load the C messages' introspection.
# tests/test_messages_between_processes.py sends each message, service and action.
find_package(rosidl_default_generators REQUIRED)
list(FILTER AMENT_EXTENSIONS_rosidl_generate_idl_interfaces EXCLUDE REGEX "^rosidl_[a-z_]*_cpp:")

set(CMAKE_C_FLAGS_RELEASE "-O1 -DNDEBUG")
set(CMAKE_CXX_FLAGS_RELEASE "-O1 -DNDEBUG")

# Parsing headers takes most of the time: all files of a library at once, but for the one whose files clash.
cmake_language(
  DEFER CALL set_target_properties
  ${PROJECT_NAME}__rosidl_typesupport_fastrtps_c ${PROJECT_NAME}__rosidl_typesupport_introspection_c
  ${PROJECT_NAME}__rosidl_typesupport_c ${PROJECT_NAME}__rosidl_generator_py
  PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0
)
