#pragma once

#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "active_matching_slam/evaluation/chart.h"
#include "active_matching_slam/experiments/experiment.h"
#include "matching_trial.h"
#include "recording.h"
#include "sequence.h"

namespace active_matching_slam {

/// One matcher on the frames of one sequence at one rate with one number of features.
struct TestBedCell {
  std::string sequence;
  double rate_hz = 30.0;
  int features = 0;
  std::string matcher;
  TrialSummary summary;
};

/// What the experiments share: sequences, reference runs, and the test-bed of all matchers, each
/// made when it is first asked for.
class Workbench {
 public:
  explicit Workbench(const LaboratorySettings& settings);

  bool quick() const { return settings_.quick; }
  void say(const std::string& what) const;

  const Sequence& sequence(const std::string& name);
  const Recording& recording(const std::string& sequence, const RecordingOptions& options);

  /// Simulated sequences, and recorded ones where there is data.
  std::vector<std::string> testBedSequences() const;
  std::vector<int> everies() const;        ///< 30 Hz over these are the rates, fastest first
  std::vector<int> featureCounts() const;  ///< ascending
  /// The sequence that the thesis's figures are held against.
  std::string mainSequence() const { return "office_slow"; }

  /// All cells: every sequence, rate, number of features and matcher.
  const std::vector<TestBedCell>& testBed();
  /// Null when there is none.
  const TestBedCell* cell(const std::string& sequence, double rate_hz, int features,
                          const std::string& matcher);

 private:
  LaboratorySettings settings_;
  std::map<std::string, Sequence> sequences_;
  std::map<std::tuple<std::string, int, int, int, int>, Recording> recordings_;
  std::vector<TestBedCell> test_bed_;
};

/// Adds the cells of all matchers on these frames.
void addCells(const Sequence& sequence, double rate_hz, int features,
              const std::vector<RecordedProblem>& problems, std::vector<TestBedCell>* cells);

/// All numbers of the cells, a row each.
Table tableOf(const std::vector<TestBedCell>& cells);

/// printf into a string.
std::string text(const char* format, ...) __attribute__((format(printf, 1, 2)));

inline Finding::Verdict verdict(bool agrees) {
  return agrees ? Finding::Verdict::kAgrees : Finding::Verdict::kDiffers;
}

// The experiments.
ExperimentResult runPinDown(Workbench& bench);
ExperimentResult runInformationMeasures(Workbench& bench);
ExperimentResult runInformationValues(Workbench& bench);
ExperimentResult runHistogramSearch(Workbench& bench);
ExperimentResult runMixtureSteps(Workbench& bench);
ExperimentResult runLookAlikes(Workbench& bench);
ExperimentResult runTrackingStep(Workbench& bench);
ExperimentResult runFeaturesAndRate(Workbench& bench);
ExperimentResult runInformationSteps(Workbench& bench);
ExperimentResult runStateSpace(Workbench& bench);
ExperimentResult runFrameClusters(Workbench& bench);
ExperimentResult runSubmaps(Workbench& bench);
ExperimentResult runSubmapsOverTime(Workbench& bench);
ExperimentResult runSmoothness(Workbench& bench);
ExperimentResult runFastMatching(Workbench& bench);
ExperimentResult runTreeSteps(Workbench& bench);
ExperimentResult runScalableMatching(Workbench& bench);
ExperimentResult runTrajectories(Workbench& bench);
ExperimentResult runMatchError(Workbench& bench);
ExperimentResult runKeyframeMap(Workbench& bench);
ExperimentResult runLucasKanade(Workbench& bench);
ExperimentResult runSubmapFilter(Workbench& bench);

}  // namespace active_matching_slam
