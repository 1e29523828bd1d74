#include "workbench.h"

#include <cstdarg>
#include <cstdio>
#include <filesystem>
#include <stdexcept>

namespace active_matching_slam {

std::string text(const char* format, ...) {
  char buffer[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer, sizeof(buffer), format, arguments);
  va_end(arguments);
  return buffer;
}

Workbench::Workbench(const LaboratorySettings& settings) : settings_(settings) {
  if (!settings.data.empty() && !std::filesystem::is_directory(settings.data))
    throw std::runtime_error("data: '" + settings.data + "' is not a folder");
}

void Workbench::say(const std::string& what) const {
  if (settings_.progress) settings_.progress(what);
}

const Sequence& Workbench::sequence(const std::string& name) {
  const auto at = sequences_.find(name);
  if (at != sequences_.end()) return at->second;
  say((isRecordedName(name) ? "reading " : "rendering ") + name);
  return sequences_.emplace(name, loadSequence(name, settings_.data, quick())).first->second;
}

const Recording& Workbench::recording(const std::string& name, const RecordingOptions& options) {
  const auto key = std::make_tuple(name, options.every, options.features, options.problems,
                                   options.template_size_px);
  const auto at = recordings_.find(key);
  if (at != recordings_.end()) return at->second;
  const Sequence& images = sequence(name);
  say(text("reference run of %s at %.4g Hz, %d features", name.c_str(), 30.0 / options.every,
           options.features));
  return recordings_.emplace(key, recordProblems(images, options)).first->second;
}

std::vector<std::string> Workbench::testBedSequences() const {
  std::vector<std::string> names = {"office_slow"};
  if (!quick()) names = {"office_slow", "office_fast", "walkway_slow", "walkway_fast"};
  if (!settings_.data.empty()) names.push_back("desk");
  if (!settings_.data.empty() && !quick()) names.push_back("checkerboard");
  return names;
}

std::vector<int> Workbench::everies() const {
  return quick() ? std::vector<int>{1, 4} : std::vector<int>{1, 2, 4, 8};
}

std::vector<int> Workbench::featureCounts() const {
  return quick() ? std::vector<int>{11, 30, 60} : std::vector<int>{11, 20, 40, 60, 100};
}

void addCells(const Sequence& sequence, double rate_hz, int features,
              const std::vector<RecordedProblem>& problems, std::vector<TestBedCell>* cells) {
  std::vector<RecordedProblem> parts;
  for (const RecordedProblem& problem : problems)
    parts.push_back(spreadFeatures(problem, features));
  const auto tryAll = [&](const MatcherVariant& variant) {
    std::vector<MatchingTrial> trials;
    for (const RecordedProblem& part : parts) trials.push_back(tryMatcher(sequence, part, variant));
    return trials;
  };
  const std::vector<MatchingTrial> jcbb = tryAll(matcherVariant("jcbb"));
  for (const MatcherVariant& variant : matcherVariants()) {
    const auto trials = variant.label == "jcbb" ? jcbb : tryAll(variant);
    cells->push_back(
        {sequence.name, rate_hz, features, variant.label, summariseTrials(trials, jcbb, parts)});
  }
}

const std::vector<TestBedCell>& Workbench::testBed() {
  if (!test_bed_.empty()) return test_bed_;
  for (const std::string& name : testBedSequences())
    for (const int every : everies()) {
      // A hasty hand between images so far apart: the ellipses cover the image, nothing is
      // predicted.
      if (every == 8 && name.find("_fast") != std::string::npos) continue;
      RecordingOptions options;
      options.every = every;
      options.features = featureCounts().back();
      options.problems = quick() ? 4 : 8;
      const Recording& reference = recording(name, options);
      for (const int features : featureCounts()) {
        say(text("all matchers with %d features on %d frames of %s at %.4g Hz (%d of %d tracked)",
                 features, static_cast<int>(reference.problems.size()), name.c_str(), 30.0 / every,
                 reference.tracked, reference.frames));
        addCells(sequence(name), 30.0 / every, features, reference.problems, &test_bed_);
      }
    }
  return test_bed_;
}

const TestBedCell* Workbench::cell(const std::string& sequence, double rate_hz, int features,
                                   const std::string& matcher) {
  for (const TestBedCell& cell : testBed())
    if (cell.sequence == sequence && cell.rate_hz == rate_hz && cell.features == features &&
        cell.matcher == matcher && cell.summary.frames > 0)
      return &cell;
  return nullptr;
}

Table tableOf(const std::vector<TestBedCell>& cells) {
  Table table({"sequence",
               "rate_hz",
               "features",
               "matcher",
               "frames",
               "candidates",
               "matched",
               "pixels",
               "gate_pixels",
               "spurious_matches",
               "right",
               "wrong",
               "missed",
               "error_px",
               "steps",
               "most_gaussians",
               "mean_most_gaussians",
               "frames_cut_short",
               "frames_same_as_jcbb",
               "information_ms",
               "correlation_ms",
               "update_ms",
               "tree_ms",
               "matching_ms",
               "rest_of_step_ms"});
  for (const TestBedCell& cell : cells) {
    const TrialSummary& s = cell.summary;
    table.add({cell.sequence,
               cell.rate_hz,
               cell.features,
               cell.matcher,
               s.frames,
               s.candidates,
               s.matched,
               s.pixels,
               s.gate_pixels,
               s.spurious,
               s.right,
               s.wrong,
               s.missed,
               s.error_px,
               s.steps,
               s.most_gaussians,
               s.mean_most_gaussians,
               s.cut_short,
               s.same_as_jcbb,
               s.information_ms,
               s.correlation_ms,
               s.update_ms,
               s.tree_ms,
               s.total_ms,
               s.other_ms});
  }
  return table;
}

}  // namespace active_matching_slam
