# Where a build folder is inside the package, rosrun, which searches a package's folder, would find a
# program once in every build folder, and scripts of the same name, and ask which. So there the
# package that ROS is told of is the devel space's own folder, as after an installation.
string(FIND "${CATKIN_DEVEL_PREFIX}/" "${CMAKE_CURRENT_SOURCE_DIR}/" at)
if(NOT at EQUAL 0)
  return()
endif()
set(share ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_SHARE_DESTINATION})
foreach(name package.xml nodelet_plugins.xml rviz_plugins.xml config launch msg rviz srv test)
  execute_process(COMMAND ${CMAKE_COMMAND} -E create_symlink
    ${CMAKE_CURRENT_SOURCE_DIR}/${name} ${share}/${name})
endforeach()
file(WRITE ${CATKIN_DEVEL_PREFIX}/.catkin ${share})
