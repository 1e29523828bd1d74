# .deb files, by CPack; scripts/package calls it. The panel for rviz is a package of its own, so that
# a robot without a screen needs neither rviz nor Qt.
if(NOT CATKIN_BUILD_BINARY_PACKAGE)
  return()
endif()
file(STRINGS /etc/os-release system_lines REGEX "^(ID|VERSION_ID)=")
string(REGEX REPLACE "[^;]*=\"?([^;\"]*)\"?" "\\1" system "${system_lines}")

# What no program links with, but the launch files and the tools start or read.
if(system MATCHES ubuntu)
  set(prefix /opt/ros/noetic)
  set(name ros-noetic-active-matching-slam)
  set(runtime compressed-image-transport dynamic-reconfigure message-runtime nodelet pluginlib
    rosbag rosbash roslaunch rosmsg rosnode rosout rosparam rosservice rostopic tf2-ros
    camera-info-manager cv-bridge diagnostic-updater image-transport roscpp sensor-msgs std-msgs
    std-srvs geometry-msgs nav-msgs visualization-msgs)
  list(TRANSFORM runtime PREPEND ros-noetic-)
  set(viewer ros-noetic-rviz)
else()
  set(prefix /usr)
  set(name active-matching-slam)
  set(runtime catkin rosbash rosout python3-roslaunch libnodeletlib-tools
    python3-dynamic-reconfigure python3-rosbag python3-rosmsg python3-rosnode python3-rosparam
    python3-rosservice python3-rostopic python3-diagnostic-msgs python3-geometry-msgs
    python3-nav-msgs python3-sensor-msgs python3-std-msgs python3-std-srvs python3-visualization-msgs
    tf2-tools
    # Their package.xml, by which ROS finds plugins.
    libimage-transport-dev libnodelet-dev)
  set(viewer rviz)
endif()
list(JOIN runtime ", " runtime)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME ${name})
set(CPACK_PACKAGE_CONTACT "The active_matching_slam authors <maintainers@active-matching-slam.invalid>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Live tracking and mapping with one camera, for ROS 1")
set(CPACK_PACKAGING_INSTALL_PREFIX ${prefix})
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION misc)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_NAME ${name})
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_DEPENDS "${runtime}")
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_RECOMMENDS "${name}-rviz")
set(CPACK_COMPONENTS_ALL Unspecified)
set(CPACK_COMPONENT_UNSPECIFIED_DESCRIPTION "An extended Kalman filter over camera and map, with \
feature matching guided by information theory (Active Matching). Nodelet, node, tools, launch files.")
if(TARGET ${PROJECT_NAME}_rviz)
  list(APPEND CPACK_COMPONENTS_ALL rviz)
  set(CPACK_DEBIAN_RVIZ_PACKAGE_NAME ${name}-rviz)
  set(CPACK_DEBIAN_RVIZ_PACKAGE_DEPENDS "${name} (= ${PROJECT_VERSION}), ${viewer}")
  set(CPACK_COMPONENT_RVIZ_DESCRIPTION "The panel of active_matching_slam in rviz, and rviz.")
endif()
include(CPack)
