# The panel for rviz, where rviz's headers and Qt are found; nothing else needs them.
find_package(rviz QUIET)
find_package(Qt5 QUIET COMPONENTS Widgets)
if(NOT rviz_FOUND OR NOT Qt5Widgets_FOUND)
  message(STATUS "rviz's headers or Qt 5 were not found: the panel for rviz is left out")
  return()
endif()

file(GLOB panel_sources CONFIGURE_DEPENDS src/rviz_panel/*.cpp)
add_library(${PROJECT_NAME}_rviz SHARED ${panel_sources}
  include/${PROJECT_NAME}/rviz_panel/tracker_panel.h)
set_target_properties(${PROJECT_NAME}_rviz PROPERTIES AUTOMOC ON)
# ROS has functions and arguments of the names that Qt makes words of its own.
target_compile_definitions(${PROJECT_NAME}_rviz PRIVATE QT_NO_KEYWORDS)
target_include_directories(${PROJECT_NAME}_rviz SYSTEM PRIVATE ${rviz_INCLUDE_DIRS})
target_link_libraries(${PROJECT_NAME}_rviz ${PROJECT_NAME}_ros ${rviz_LIBRARIES} Qt5::Widgets)
install(TARGETS ${PROJECT_NAME}_rviz LIBRARY DESTINATION ${AMS_PLUGIN_DESTINATION}
  COMPONENT rviz)

if(CATKIN_ENABLE_TESTING)
  find_package(Qt5 QUIET COMPONENTS Test)
  if(NOT Qt5Test_FOUND)
    return()
  endif()
  # Beside a live tracker, on a screen without a display: test/rviz_panel/panel_test.py starts it.
  add_executable(panel_clicks EXCLUDE_FROM_ALL test/rviz_panel/panel_clicks.cpp)
  target_compile_definitions(panel_clicks PRIVATE QT_NO_KEYWORDS)
  target_include_directories(panel_clicks SYSTEM PRIVATE ${rviz_INCLUDE_DIRS} ${GTEST_INCLUDE_DIRS})
  target_link_libraries(panel_clicks ${PROJECT_NAME}_ros ${rviz_LIBRARIES} Qt5::Widgets Qt5::Test
    gtest)
  set_target_properties(panel_clicks PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION})
  add_dependencies(tests panel_clicks)
  configure_file(test/rviz_panel/rviz_panel.test.in ${CMAKE_CURRENT_BINARY_DIR}/rviz_panel.test @ONLY)
  add_rostest(${CMAKE_CURRENT_BINARY_DIR}/rviz_panel.test
    DEPENDENCIES ros_test_bag panel_clicks ${PROJECT_NAME}_rviz ${PROJECT_NAME}_node)
endif()
