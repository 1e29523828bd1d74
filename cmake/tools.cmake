# What the tools share. Of the ROS layer they need how messages are read and made.
file(GLOB tool_common_sources CONFIGURE_DEPENDS src/tools/common/*.cpp)
add_library(ams_tools STATIC ${tool_common_sources} src/ros/data_directory.cpp
  src/ros/image_conversions.cpp src/ros/one_camera.cpp src/ros/pose_conversions.cpp
  src/ros/motion_conversions.cpp src/ros/frame_conversions.cpp)
add_dependencies(ams_tools ${PROJECT_NAME}_generate_messages_cpp)
target_include_directories(ams_tools SYSTEM PUBLIC ${catkin_INCLUDE_DIRS})
target_link_libraries(ams_tools PUBLIC ams_offline ${catkin_LIBRARIES} ${Boost_LIBRARIES})

# One executable a file of src/tools, named after it.
file(GLOB tool_sources CONFIGURE_DEPENDS src/tools/*.cpp)
foreach(source ${tool_sources})
  get_filename_component(tool ${source} NAME_WE)
  add_executable(${tool} ${source})
  target_include_directories(${tool} SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
  target_link_libraries(${tool} ams_tools)
  set_target_properties(${tool} PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION})
  if(tool STREQUAL "reproduce")
    target_sources(${tool} PRIVATE $<TARGET_OBJECTS:ams_experiments>)
  endif()
  install(TARGETS ${tool} RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
endforeach()

if(CATKIN_ENABLE_TESTING)
  file(GLOB tool_tests CONFIGURE_DEPENDS test/tools/*_test.cpp)
  catkin_add_gtest(test_tools ${tool_tests}
    WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/test)
  target_include_directories(test_tools PRIVATE src test)
  target_include_directories(test_tools SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
  target_compile_definitions(test_tools PRIVATE TRACK_BAG="$<TARGET_FILE:track_bag>"
    IMAGES_TO_BAG="$<TARGET_FILE:images_to_bag>" CHECK_VECTORS="$<TARGET_FILE:check_vectors>"
    REPRODUCE="$<TARGET_FILE:reproduce>" CONSISTENCY="$<TARGET_FILE:consistency>")
  target_link_libraries(test_tools ams_tools gtest_main)
  add_dependencies(test_tools track_bag images_to_bag check_vectors reproduce consistency)
endif()
