# Where pluginlib looks for plugins: with the other libraries of a catkin space; but in a system where
# none is sourced (Debian's own ROS) in one place alone.
set(AMS_PLUGIN_DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION})
file(STRINGS /etc/os-release system_lines REGEX "^ID=")
if(CATKIN_BUILD_BINARY_PACKAGE AND system_lines MATCHES "debian")
  set(AMS_PLUGIN_DESTINATION lib/${CMAKE_LIBRARY_ARCHITECTURE}/ros)
endif()
