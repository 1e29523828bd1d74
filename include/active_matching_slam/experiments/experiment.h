#pragma once

#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "active_matching_slam/experiments/table.h"
#include "active_matching_slam/simulation/named_choice.h"

namespace active_matching_slam {

/// What the thesis says about something, and what came out here.
struct Finding {
  enum class Verdict {
    kAgrees,
    kDiffers,
    kNoVerdict  ///< a figure to look at: hardware, images or features are not the thesis's
  };
  std::string quantity;
  std::string thesis;
  std::string here;
  Verdict verdict = Verdict::kNoVerdict;
  bool is_duration = false;  ///< `here` or the verdict rests on measured time
};

struct ExperimentResult {
  std::vector<std::pair<std::string, Table>> tables;      ///< by suffix of the file, "" for one
  std::vector<std::pair<std::string, cv::Mat>> pictures;  ///< 8-bit BGR, likewise
  std::vector<Finding> findings;
};

struct LaboratorySettings {
  std::string data;    ///< folder of the recorded sequences; empty: simulated ones alone
  bool quick = false;  ///< short sequences, small images, few frames
  std::function<void(const std::string&)> progress;  ///< called with each step; may be empty
};

/// Names of the experiments, each after the first table or figure of the thesis that it repeats, in
/// the order of the thesis.
const std::vector<NamedChoice>& experimentChoices();

class Workbench;

/// Runs experiments (Chli 2009, chapters 4 to 7) and keeps what several of them need. The same
/// settings give the same result bit for bit, durations apart, in whatever order they are run.
class Laboratory {
 public:
  /// Throws std::runtime_error when `data` is given and is not a folder.
  explicit Laboratory(const LaboratorySettings& settings);
  ~Laboratory();

  /// Throws std::invalid_argument that lists the names for an unknown one, std::runtime_error
  /// naming a recording that can't be read.
  ExperimentResult run(const std::string& name);

 private:
  std::unique_ptr<Workbench> workbench_;
};

/// Durations of the matchers are processor time of the calling thread, so that what else runs on
/// the machine disturbs them little [s].
double threadSeconds();

/// "agrees", "differs" or "".
std::string verdictName(Finding::Verdict verdict);

/// Writes <name>.csv, <name>.png and <name>.findings.csv (with _<suffix> where there are several)
/// into an existing directory. Throws std::runtime_error naming the file.
void writeResult(const std::string& directory, const std::string& name,
                 const ExperimentResult& result);

}  // namespace active_matching_slam
