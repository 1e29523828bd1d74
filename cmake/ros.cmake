# The ROS layer: one library, and over it a nodelet and a node that are shells.
file(GLOB ros_sources CONFIGURE_DEPENDS src/ros/*.cpp)
add_library(${PROJECT_NAME}_ros SHARED ${ros_sources})
target_include_directories(${PROJECT_NAME}_ros PUBLIC include)
target_include_directories(${PROJECT_NAME}_ros SYSTEM PUBLIC ${catkin_INCLUDE_DIRS}
  ${CATKIN_DEVEL_PREFIX}/${CATKIN_GLOBAL_INCLUDE_DESTINATION})
target_link_libraries(${PROJECT_NAME}_ros PUBLIC ${PROJECT_NAME} ${catkin_LIBRARIES}
  Boost::filesystem)
add_dependencies(${PROJECT_NAME}_ros ${PROJECT_NAME}_generate_messages_cpp)

add_library(${PROJECT_NAME}_nodelets SHARED src/ros/nodelet/tracker_nodelet.cpp)
target_link_libraries(${PROJECT_NAME}_nodelets ${PROJECT_NAME}_ros)

add_executable(${PROJECT_NAME}_node src/ros/node/${PROJECT_NAME}_node.cpp)
target_link_libraries(${PROJECT_NAME}_node ${PROJECT_NAME}_ros)

if(CATKIN_ENABLE_TESTING)
  file(GLOB ros_tests CONFIGURE_DEPENDS test/ros/*_test.cpp)
  catkin_add_gtest(test_ros ${ros_tests}
    WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/test)
  target_include_directories(test_ros PRIVATE test)
  target_link_libraries(test_ros ${PROJECT_NAME}_ros ams_offline gtest_main)

  # Tests with a master play a recording that is rendered when the tests are built.
  find_package(rostest REQUIRED)
  set(test_data ${CMAKE_CURRENT_BINARY_DIR}/test_data)
  set(test_bag ${test_data}/room.bag)
  add_custom_command(OUTPUT ${test_bag}
    COMMAND ${CMAKE_COMMAND} -E make_directory ${test_data}
    COMMAND simulate_bag --scene room --motion slow --size 320x240 --rate 30 --seconds 4
      --seed 3 --output ${test_bag}
    DEPENDS simulate_bag)
  add_custom_target(ros_test_bag DEPENDS ${test_bag})
  add_dependencies(tests ros_test_bag)
  file(GLOB ros_launch_tests CONFIGURE_DEPENDS test/ros/*.test.in)
  foreach(template ${ros_launch_tests})
    get_filename_component(name ${template} NAME_WE)
    configure_file(${template} ${CMAKE_CURRENT_BINARY_DIR}/${name}.test @ONLY)
    add_rostest(${CMAKE_CURRENT_BINARY_DIR}/${name}.test
      DEPENDENCIES ros_test_bag ${PROJECT_NAME}_node ${PROJECT_NAME}_nodelets)
  endforeach()
endif()
