// Runs the executable (its path is compiled in as REPRODUCE).

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace active_matching_slam {
namespace {

class Reproduce : public testing::Test {
 protected:
  void SetUp() override {
    directory_ = "/tmp/ams_reproduce_" + std::to_string(getpid());
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  std::string contentOf(const std::string& name) const {
    std::ifstream file(directory_ + "/" + name, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }
  int run(const std::string& arguments) const {
    const int status = std::system((std::string(REPRODUCE) + " " + arguments + " >" + directory_ +
                                    "/stdout.txt 2>" + directory_ + "/stderr.txt")
                                       .c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  void expectFault(const std::string& arguments, const std::string& part) const {
    EXPECT_EQ(run(arguments), 2) << arguments;
    const std::string errors = contentOf("stderr.txt");
    EXPECT_EQ(std::count(errors.begin(), errors.end(), '\n'), 1) << errors;
    EXPECT_NE(errors.find(part), std::string::npos) << errors;
  }

  std::string directory_;
};

TEST_F(Reproduce, WritesTheFilesOfAnExperimentAndSaysWhatTheThesisSays) {
  ASSERT_EQ(run("fig_5_3 --quick --output " + directory_ + "/out"), 0) << contentOf("stderr.txt");
  for (const char* file : {"fig_5_3.csv", "fig_5_3.png", "fig_5_3.findings.csv", "machine.txt"})
    EXPECT_TRUE(std::filesystem::exists(directory_ + "/out/" + file)) << file;
  EXPECT_NE(contentOf("stdout.txt").find("thesis: "), std::string::npos);
}

TEST_F(Reproduce, HelpListsTheExperiments) {
  ASSERT_EQ(run("--help"), 0);
  EXPECT_NE(contentOf("stdout.txt").find("table_7_1"), std::string::npos);
}

TEST_F(Reproduce, FaultsAreNamedInOneLine) {
  const std::string output = " --output " + directory_ + "/out";
  expectFault("", "name");
  expectFault("fig_5_3", "--output");
  expectFault("potato" + output, "table_5_2");
  expectFault("fig_5_3 --data /nonexistent" + output, "/nonexistent");
  expectFault("fig_5_3 --output /dev/null/x", "/dev/null/x");
  expectFault("fig_5_3 --quack" + output, "quack");
}

}  // namespace
}  // namespace active_matching_slam
