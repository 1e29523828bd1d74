/// play_demo: plays a small film of a rendered room by rosbag. Rendered once, on this computer: the
/// film of a package would be larger than the package. demo.launch starts it.

#include <unistd.h>

#include <boost/filesystem.hpp>
#include <boost/process.hpp>
#include <cerrno>
#include <cstring>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "active_matching_slam/ros/data_directory.h"
#include "common/tool_main.h"

namespace ams = active_matching_slam;

namespace {

const char* const kUsage =
    "play_demo [ARGUMENT...]\n"
    "  Renders a film of 10 s into demo.bag in ~/.ros/active_matching_slam (below ROS_HOME, where\n"
    "  that is set), unless it is there, and becomes 'rosbag play --quiet ARGUMENT... demo.bag'.\n"
    "  --help  this text\n";

/// The program beside this one.
boost::filesystem::path siblingProgram(const std::string& name) {
  return boost::filesystem::read_symlink("/proc/self/exe").parent_path() / name;
}

void render(const std::string& film) {
  std::cout << "play_demo: rendering a film of a room, once: " << film << std::endl;
  const int status = boost::process::system(siblingProgram("simulate_bag"), "--scene", "room",
                                            "--motion", "slow", "--size", "320x240", "--rate", "30",
                                            "--seconds", "10", "--seed", "1", "--output", film);
  if (status != 0) throw std::runtime_error("simulate_bag failed, see above");
}

[[noreturn]] void play(const std::vector<std::string>& arguments) {
  std::vector<std::string> words = {"rosrun", "rosbag", "play", "--quiet"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(&word[0]);
  pointers.push_back(nullptr);
  execvp(pointers[0], pointers.data());
  throw std::runtime_error(std::string("rosrun can't be started: ") + std::strerror(errno));
}

int run(int argc, char** argv) {
  std::vector<std::string> arguments(argv + 1, argv + argc);
  if (argc == 2 && arguments[0] == "--help") {
    std::cout << kUsage;
    return 0;
  }
  const ams::DataDirectory directory("");
  directory.create();
  const std::string film = directory.resolve("demo.bag");
  if (!boost::filesystem::exists(film)) render(film);
  arguments.push_back(film);
  play(arguments);
}

}  // namespace

int main(int argc, char** argv) {
  return ams::runTool("play_demo", [&] { return run(argc, argv); });
}
