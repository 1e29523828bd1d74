# Documents are tested against the built tools. Tests with a ROS master run one at a time: they hold
# the node to what it does in real time.
if(NOT CATKIN_ENABLE_TESTING)
  return()
endif()
# catkin keeps a picture of the environment for tests, and leaves out of it the folders that are not
# there yet: in a fresh build those of the Python messages. Make them, and take the picture again.
file(MAKE_DIRECTORY ${CATKIN_DEVEL_PREFIX}/lib
  ${CATKIN_DEVEL_PREFIX}/${CATKIN_GLOBAL_PYTHON_DESTINATION})
execute_process(COMMAND ${PYTHON_EXECUTABLE}
  ${CMAKE_BINARY_DIR}/catkin_generated/generate_cached_setup.py)

add_test(NAME ${PROJECT_NAME}_documents
  COMMAND ${PYTHON_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/test/documents/documents_test.py)
set_tests_properties(${PROJECT_NAME}_documents PROPERTIES ENVIRONMENT
  AMS_PROGRAMS=${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION})

# The commands of the documents as they stand there, the advice on several machines, and whether
# rosrun finds what the documents name.
foreach(name commands machines rosrun)
  add_test(NAME ${PROJECT_NAME}_${name} COMMAND ${CATKIN_ENV} ${PYTHON_EXECUTABLE}
    ${CMAKE_CURRENT_SOURCE_DIR}/test/documents/${name}_test.py)
  set_tests_properties(${PROJECT_NAME}_${name} PROPERTIES ENVIRONMENT
    "AMS_PROGRAMS=${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION};AMS_TEST_BAG=${test_bag};AMS_BUILT=${CMAKE_BINARY_DIR}")
endforeach()

# What the page of reproductions says of the quick run.
add_test(NAME ${PROJECT_NAME}_reproduction
  COMMAND ${PYTHON_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/test/documents/reproduction_test.py)
set_tests_properties(${PROJECT_NAME}_reproduction PROPERTIES ENVIRONMENT
  AMS_PROGRAMS=${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION})

add_test(NAME ${PROJECT_NAME}_compare_runs COMMAND ${CATKIN_ENV} ${PYTHON_EXECUTABLE}
  ${CMAKE_CURRENT_SOURCE_DIR}/test/tools/compare_runs_test.py)
set_tests_properties(${PROJECT_NAME}_compare_runs PROPERTIES ENVIRONMENT
  AMS_PROGRAMS=${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION})

add_test(NAME ${PROJECT_NAME}_update_results COMMAND ${CATKIN_ENV} ${PYTHON_EXECUTABLE}
  ${CMAKE_CURRENT_SOURCE_DIR}/test/tools/update_results_test.py)
set_tests_properties(${PROJECT_NAME}_update_results PROPERTIES ENVIRONMENT
  AMS_PROGRAMS=${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION})

add_test(NAME ${PROJECT_NAME}_house
  COMMAND ${PYTHON_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/test/house/include_graph_test.py)
add_test(NAME ${PROJECT_NAME}_words
  COMMAND ${PYTHON_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/test/house/words_test.py)
add_test(NAME ${PROJECT_NAME}_constants
  COMMAND ${PYTHON_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/test/house/constants_test.py)
add_test(NAME ${PROJECT_NAME}_symbols
  COMMAND ${PYTHON_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/test/house/symbols_test.py
    $<TARGET_FILE:${PROJECT_NAME}>)

# The long runs of test_accuracy, in two halves: AMS_ACCURACY=1 ctest -L accuracy
foreach(half 0 1)
  set(test ${PROJECT_NAME}_accuracy_${half})
  add_test(NAME ${test} WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/test
    COMMAND test_accuracy --gtest_filter=*Long*
      --gtest_output=xml:${CMAKE_BINARY_DIR}/test_results/${PROJECT_NAME}/${test}.xml)
  set_tests_properties(${test} PROPERTIES LABELS accuracy TIMEOUT 14400
    ENVIRONMENT "GTEST_TOTAL_SHARDS=2;GTEST_SHARD_INDEX=${half}"
    SKIP_REGULAR_EXPRESSION "AMS_ACCURACY is not set")
endforeach()

get_property(tests DIRECTORY PROPERTY TESTS)
foreach(test ${tests})
  # As in the node and the tools: results must not depend on the number of cores.
  set_property(TEST ${test} APPEND PROPERTY ENVIRONMENT OPENBLAS_NUM_THREADS=1)
  if(test MATCHES "_test_accuracy$")
    set_property(TEST ${test} APPEND PROPERTY ENVIRONMENT GTEST_FILTER=-*Long*)
  endif()
  if(test MATCHES "_rostest_|_commands$|_machines$")
    set_tests_properties(${test} PROPERTIES RUN_SERIAL TRUE)
  elseif(test MATCHES "_accuracy")
    set_property(TEST ${test} PROPERTY COST 1000)  # the longest begin first
  endif()
endforeach()
