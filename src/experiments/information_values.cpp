// Figures 4.5 and 4.6: what the measurement of a feature tells of all others together (eq. 4.31),
// what it leaves of their uncertainty, and what it tells of each of them (eq. 4.35).

#include <algorithm>
#include <cmath>
#include <numeric>

#include "active_matching_slam/information/gaussian_information.h"
#include "active_matching_slam/visualisation/debug_canvas.h"
#include "match_replay.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

constexpr int kValuedFeatures = 14;  // as in figure 4.5

double meanValue(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double covarianceOf(const std::vector<double>& x, const std::vector<double>& y) {
  const double mx = meanValue(x), my = meanValue(y);
  double sum = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) sum += (x[i] - mx) * (y[i] - my);
  return sum / static_cast<double>(x.size());
}

double spreadOf(const std::vector<double>& values) {
  return std::sqrt(covarianceOf(values, values)) / meanValue(values);
}

/// Of one frame's prediction.
struct Values {
  JointPoints joint;
  std::vector<double> bits;         ///< of each with all others
  std::vector<double> shrink_bits;  ///< by which the measurement of each shrinks the others
  Eigen::MatrixXd pairs;
  int most = 0, least = 0;

  std::vector<double> pairsOf(int feature) const {
    std::vector<double> result;
    for (int k = 0; k < pairs.cols(); ++k)
      if (k != feature) result.push_back(pairs(feature, k));
    return result;
  }
};

/// As if the feature were found where it is predicted.
JointPoints measured(const JointPoints& joint, int feature) {
  JointPoints after = joint;
  after.condition(feature, joint.mean(feature));
  return after;
}

Values valuesOf(const MeasurementPrior& prior) {
  Values v;
  v.joint = {prior.z, prior.S};
  v.pairs = pairInformationMatrix(prior.S);
  const Eigen::VectorXd bits = featureInformation(prior.S).bits;
  v.bits.assign(bits.data(), bits.data() + bits.size());
  for (int f = 0; f < prior.size(); ++f) {
    std::vector<int> others;
    for (int k = 0; k < prior.size(); ++k)
      if (k != f) others.push_back(k);
    v.shrink_bits.push_back(meanShrinkBits(v.joint, measured(v.joint, f), others));
  }
  v.most = static_cast<int>(std::max_element(v.bits.begin(), v.bits.end()) - v.bits.begin());
  v.least = static_cast<int>(std::min_element(v.bits.begin(), v.bits.end()) - v.bits.begin());
  return v;
}

cv::Mat drawCandidates(const cv::Mat& image, const Values& v, int feature) {
  DebugCanvas canvas(image);
  const cv::Scalar before(90, 90, 240), after(80, 220, 80), ink(255, 255, 255);
  drawJoint(v.joint, before, &canvas);
  if (feature >= 0) drawJoint(measured(v.joint, feature), after, &canvas);
  for (std::size_t f = 0; f < v.bits.size(); ++f)
    if (feature < 0 || static_cast<int>(f) == feature)
      canvas.label(v.joint.mean(static_cast<int>(f)), text("%.1f", v.bits[f]), ink);
  return captioned(canvas.image(), canvas.unit(),
                   feature < 0 ? "bits with all others"
                               : text("ellipses before and after the one of %.1f bits",
                                      v.bits[static_cast<std::size_t>(feature)]));
}

cv::Mat drawLinks(const cv::Mat& image, const Values& v) {
  DebugCanvas canvas(image);
  const double strongest = v.pairs.row(v.most).maxCoeff();
  for (int k = 0; k < v.pairs.cols(); ++k) {
    if (k == v.most) continue;
    const double share = v.pairs(v.most, k) / strongest;
    canvas.line(v.joint.mean(v.most), v.joint.mean(k), cv::Scalar(60, 220, 255 * share),
                0.5 + 3.0 * share);
    canvas.label(v.joint.mean(k), text("%.1f", v.pairs(v.most, k)), {255, 255, 255});
  }
  return captioned(canvas.image(), canvas.unit(), "bits with one feature");
}

}  // namespace

ExperimentResult runInformationValues(Workbench& bench) {
  Table table({"sequence", "image", "feature", "information_bits", "shrink_bits",
               "strongest_pair_bits", "sum_of_pairs_bits"});
  ExperimentResult result;
  std::vector<double> after_most, after_least, correlations, spread_features, spread_pairs, ratios;
  int frames = 0, most_wins = 0, pairs_vary_more = 0, overlapping = 0;
  for (const std::string& name : bench.testBedSequences()) {
    RecordingOptions options;
    options.every = 4;
    options.features = bench.featureCounts().back();
    options.problems = bench.quick() ? 4 : 8;
    const Recording& recording = bench.recording(name, options);
    for (std::size_t p = 0; p < recording.problems.size(); ++p) {
      const RecordedProblem problem = spreadFeatures(recording.problems[p], kValuedFeatures);
      if (problem.prior.size() < kValuedFeatures) continue;
      const Values v = valuesOf(problem.prior);
      const auto most = static_cast<std::size_t>(v.most), least = static_cast<std::size_t>(v.least);
      ++frames;
      most_wins += v.shrink_bits[most] > v.shrink_bits[least];
      after_most.push_back(v.shrink_bits[most]);
      after_least.push_back(v.shrink_bits[least]);
      const double scale =
          std::sqrt(covarianceOf(v.bits, v.bits) * covarianceOf(v.shrink_bits, v.shrink_bits));
      if (scale > 0.0) correlations.push_back(covarianceOf(v.bits, v.shrink_bits) / scale);
      const std::vector<double> of_most = v.pairsOf(v.most);
      spread_features.push_back(spreadOf(v.bits));
      spread_pairs.push_back(spreadOf(of_most));
      pairs_vary_more += spread_pairs.back() > spread_features.back();
      for (int f = 0; f < kValuedFeatures; ++f) {
        const auto slot = static_cast<std::size_t>(f);
        const std::vector<double> pairs = v.pairsOf(f);
        const double sum = std::accumulate(pairs.begin(), pairs.end(), 0.0);
        ratios.push_back(sum / v.bits[slot]);
        overlapping += sum > v.bits[slot];
        table.add({name, problem.image, f, v.bits[slot], v.shrink_bits[slot],
                   *std::max_element(pairs.begin(), pairs.end()), sum});
      }
      if (name == bench.mainSequence() && p == recording.problems.size() / 2) {
        const cv::Mat& image = bench.sequence(name).images[static_cast<std::size_t>(problem.image)];
        result.pictures.emplace_back(
            "", tilePictures({drawCandidates(image, v, -1), drawLinks(image, v),
                              drawCandidates(image, v, v.least), drawCandidates(image, v, v.most)},
                             2));
      }
    }
  }
  result.tables.emplace_back("", table);
  if (frames == 0) return result;
  const auto areaLeft = [](const std::vector<double>& bits) {
    return 100.0 * std::exp2(-meanValue(bits));
  };
  result.findings.push_back(
      {"area of the other ellipses, once the feature with most, with least MI is measured",
       "reduced much more by the one with most (of 14; 7 against 1.9 bits)",
       text("%.1f %%, %.1f %%; less in %d of %d frames", areaLeft(after_most),
            areaLeft(after_least), most_wins, frames),
       verdict(most_wins == frames)});
  result.findings.push_back(
      {"correlation of a feature's MI with the bits by which the other ellipses shrink",
       "MI is the total reduction of uncertainty", text("%.2f", meanValue(correlations))});
  result.findings.push_back(
      {"spread (deviation over mean) of features' MI, and of a feature's MI with each other",
       "the former do not vary much, the latter pick up subtle differences",
       text("%.2f, %.2f; more in %d of %d frames", meanValue(spread_features),
            meanValue(spread_pairs), pairs_vary_more, frames),
       verdict(pairs_vary_more == frames)});
  result.findings.push_back(
      {"sum of a feature's pairwise MI over its MI with all others",
       "not the same: what it tells to one overlaps with what it tells to another",
       text("%.2f; more than 1 for %d of %zu features", meanValue(ratios), overlapping,
            ratios.size()),
       verdict(overlapping > 0.9 * static_cast<double>(ratios.size()))});
  return result;
}

}  // namespace active_matching_slam
