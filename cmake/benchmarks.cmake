# One Google Benchmark executable a file of benchmark/, where the library is installed.
find_package(benchmark QUIET)
if(NOT benchmark_FOUND)
  return()
endif()
file(GLOB benchmark_sources CONFIGURE_DEPENDS benchmark/*_benchmark.cpp)
foreach(source ${benchmark_sources})
  get_filename_component(name ${source} NAME_WE)
  add_executable(${name} ${source} benchmark/process_settings.cpp)
  target_link_libraries(${name} ams_offline benchmark::benchmark)
  set_target_properties(${name} PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION})
endforeach()
