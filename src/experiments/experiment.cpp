#include "active_matching_slam/experiments/experiment.h"

#include <time.h>

#include <opencv2/core.hpp>

#include "active_matching_slam/evaluation/chart.h"
#include "active_matching_slam/evaluation/text_file.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

struct Experiment {
  NamedChoice choice;
  ExperimentResult (*run)(Workbench&);
};

const std::vector<Experiment>& experiments() {
  static const std::vector<Experiment> list = {
      {{"fig_4_2", "figures 4.2, 4.3: an object pinned down by MI, and by MI per pixel"},
       runPinDown},
      {{"fig_4_4", "figure 4.4: information about the other features, and about the camera"},
       runInformationMeasures},
      {{"fig_4_5", "figures 4.5, 4.6: what a feature tells of all others, and of each"},
       runInformationValues},
      {{"fig_5_3", "figure 5.3: search of a line, pixel by pixel, with a histogram"},
       runHistogramSearch},
      {{"fig_5_4", "figures 5.4, 5.6: Active Matching of a frame step by step"}, runMixtureSteps},
      {{"fig_5_7", "figure 5.7: places that look alike, by feature and by scale"}, runLookAlikes},
      {{"table_5_2", "table 5.2: one tracking step with 11 features, JCBB and AM"},
       runTrackingStep},
      {{"fig_5_10", "figures 5.10 to 5.13: AM and JCBB by number of features and frame rate"},
       runFeaturesAndRate},
      {{"fig_5_14", "figures 5.14, 5.15: information by matching step"}, runInformationSteps},
      {{"fig_6_4", "figure 6.4: information in the spaces of state and of measurements"},
       runStateSpace},
      {{"fig_6_7", "figure 6.7: clusters of the features of one frame"}, runFrameClusters},
      {{"table_6_1", "table 6.1, figures 6.13, 6.14: information that submaps preserve"},
       runSubmaps},
      {{"fig_6_10", "figures 6.10, 6.11: submaps that come apart, and those of a larger place"},
       runSubmapsOverTime},
      {{"fig_7_1", "figure 7.1: smoothness of the trajectory by the number of features"},
       runSmoothness},
      {{"fig_7_2", "figures 7.2, 7.3: FAM and JCBB by number of features and frame rate"},
       runFastMatching},
      {{"fig_7_6", "figure 7.6: Chow-Liu Active Matching of a frame step by step"}, runTreeSteps},
      {{"table_7_1", "figures 7.7, 7.8, table 7.1: pixels and time of CLAM, to 400 features"},
       runScalableMatching},
      {{"fig_7_9", "figures 7.9 to 7.11: trajectories of AM, CLAM and FAM"}, runTrajectories},
      {{"fig_7_13",
        "figures 7.12, 7.13: match error against a reference, by size of the templates"},
       runMatchError},
      {{"eq_7_33", "equation 7.33: matchers on a map of keyframes"}, runKeyframeMap},
      {{"lucas_kanade", "what else one would take: pyramidal Lucas-Kanade and RANSAC PnP"},
       runLucasKanade},
      {{"submap_filter", "chapter 8: laps with a filter on a tree of submaps, MI against naive"},
       runSubmapFilter},
  };
  return list;
}

std::string fileName(const std::string& directory, const std::string& name,
                     const std::string& suffix) {
  return directory + "/" + name + (suffix.empty() ? "" : "_" + suffix);
}

}  // namespace

double threadSeconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

const std::vector<NamedChoice>& experimentChoices() {
  static const std::vector<NamedChoice> choices = [] {
    std::vector<NamedChoice> result;
    for (const Experiment& experiment : experiments()) result.push_back(experiment.choice);
    return result;
  }();
  return choices;
}

Laboratory::Laboratory(const LaboratorySettings& settings)
    : workbench_(std::make_unique<Workbench>(settings)) {}
Laboratory::~Laboratory() = default;

ExperimentResult Laboratory::run(const std::string& name) {
  checkChoice("experiment", name, experimentChoices());
  cv::setNumThreads(1);  // durations are of one core
  cv::setRNGSeed(1);     // whatever ran before
  for (const Experiment& experiment : experiments())
    if (experiment.choice.name == name) return experiment.run(*workbench_);
  return {};
}

std::string verdictName(Finding::Verdict verdict) {
  switch (verdict) {
    case Finding::Verdict::kAgrees:
      return "agrees";
    case Finding::Verdict::kDiffers:
      return "differs";
    case Finding::Verdict::kNoVerdict:
      return "";
  }
  return "";
}

void writeResult(const std::string& directory, const std::string& name,
                 const ExperimentResult& result) {
  for (const auto& [suffix, table] : result.tables)
    writeTextFile(fileName(directory, name, suffix) + ".csv", table.csv());
  for (const auto& [suffix, picture] : result.pictures)
    writePicture(fileName(directory, name, suffix) + ".png", picture);
  Table findings({"quantity", "thesis", "here", "verdict", "is_duration"});
  for (const Finding& finding : result.findings)
    findings.add({finding.quantity, finding.thesis, finding.here, verdictName(finding.verdict),
                  finding.is_duration});
  writeTextFile(directory + "/" + name + ".findings.csv", findings.csv());
}

}  // namespace active_matching_slam
