// Figure 5.3: a feature is looked for on a line of pixels, one by one, and the probability of every
// place follows by Bayes' rule (eq. 5.1).

#include <cmath>
#include <functional>
#include <numeric>

#include "workbench.h"

namespace active_matching_slam {
namespace {

constexpr int kPixels = 101, kMiddle = 50;
constexpr double kPriorSigma = 12.0, kMatchSigma = 1.0;
constexpr double kFalsePositive = 0.02, kTruePositive = 0.9;  // C_FP, C_TP
constexpr int kMatches[] = {39, 58};                          // the pixels that answer

using Histogram = std::vector<double>;

void normalise(Histogram* histogram) {
  const double sum = std::accumulate(histogram->begin(), histogram->end(), 0.0);
  for (double& value : *histogram) value /= sum;
}

Histogram gaussian(double mean, double sigma) {
  Histogram histogram;
  for (int k = 0; k < kPixels; ++k)
    histogram.push_back(std::exp(-0.5 * std::pow((k - mean) / sigma, 2)));
  normalise(&histogram);
  return histogram;
}

void observe(int pixel, bool is_match, Histogram* histogram) {
  for (int k = 0; k < kPixels; ++k) {
    const double match =
        kFalsePositive + kTruePositive * std::exp(-0.5 * std::pow((pixel - k) / kMatchSigma, 2));
    (*histogram)[static_cast<std::size_t>(k)] *= is_match ? match : 1.0 - match;
  }
  normalise(histogram);
}

bool answers(int pixel) { return pixel == kMatches[0] || pixel == kMatches[1]; }

double massNear(const Histogram& histogram, int pixel) {
  double mass = 0.0;
  for (int k = pixel - 3; k <= pixel + 3; ++k) mass += histogram[static_cast<std::size_t>(k)];
  return mass;
}

struct Moments {
  double mean, sigma;
};
Moments momentsOf(const Histogram& histogram, int first, int last) {
  double mass = 0.0, sum = 0.0, squares = 0.0;
  for (int k = first; k <= last; ++k) {
    const double p = histogram[static_cast<std::size_t>(k)];
    mass += p;
    sum += p * k;
    squares += p * k * k;
  }
  const double mean = sum / mass;
  return {mean, std::sqrt(std::max(1e-6, squares / mass - mean * mean))};
}

/// Kullback-Leibler divergence [bits].
double bitsLost(const Histogram& truth, const Histogram& model) {
  double bits = 0.0;
  for (std::size_t k = 0; k < truth.size(); ++k)
    if (truth[k] > 0.0) bits += truth[k] * std::log2(truth[k] / std::max(model[k], 1e-300));
  return bits;
}

cv::Mat draw(const std::string& title, const Histogram& prior, const Histogram& now) {
  LineChart chart{title, "pixel", "probability"};
  chart.markers = false;
  chart.series = {{"prior", {}}, {"now", {}}};
  for (int k = 0; k < kPixels; ++k) {
    chart.series[0].points.emplace_back(k, prior[static_cast<std::size_t>(k)]);
    chart.series[1].points.emplace_back(k, now[static_cast<std::size_t>(k)]);
  }
  return drawLineChart(chart, 560, 360);
}

}  // namespace

ExperimentResult runHistogramSearch(Workbench& /*bench*/) {
  const Histogram prior = gaussian(kMiddle, kPriorSigma);
  Histogram success = prior, failure = prior, between = prior;
  observe(kMiddle, true, &success);
  observe(kMiddle, false, &failure);
  for (int k = kMiddle - 6; k <= kMiddle + 6; ++k) observe(k, answers(k), &between);
  Histogram last = prior;
  for (int k = 0; k < kPixels; ++k) observe(k, answers(k), &last);

  Table table({"pixel", "prior", "after_match", "after_failure", "between", "final"});
  for (int k = 0; k < kPixels; ++k) {
    const auto slot = static_cast<std::size_t>(k);
    table.add({k, prior[slot], success[slot], failure[slot], between[slot], last[slot]});
  }
  // One Gaussian, and one for each match beside a wide one for what is left.
  const Moments all = momentsOf(last, 0, kPixels - 1);
  const Histogram single = gaussian(all.mean, all.sigma);
  Histogram mixture(kPixels, 0.0);
  double rest = 1.0;
  for (const int match : kMatches) {
    const double mass = massNear(last, match);
    const Moments moments = momentsOf(last, match - 3, match + 3);
    const Histogram peak = gaussian(moments.mean, moments.sigma);
    for (std::size_t k = 0; k < mixture.size(); ++k) mixture[k] += mass * peak[k];
    rest -= mass;
  }
  for (std::size_t k = 0; k < mixture.size(); ++k) mixture[k] += rest * prior[k];

  ExperimentResult result;
  result.tables.emplace_back("", table);
  result.pictures.emplace_back("", tilePictures({draw("a match in the middle", prior, success),
                                                 draw("no match in the middle", prior, failure),
                                                 draw("13 pixels looked at", prior, between),
                                                 draw("all pixels looked at", prior, last)},
                                                2));
  const double ratio_match = success[kMiddle] / prior[kMiddle];
  const double ratio_failure = failure[kMiddle] / prior[kMiddle];
  result.findings.push_back({"a match at the most probable pixel", "a spike",
                             text("%.1f times as probable", ratio_match),
                             verdict(ratio_match > 5)});
  result.findings.push_back({"no match at the most probable pixel", "a trough",
                             text("%.2f times as probable", ratio_failure),
                             verdict(ratio_failure < 0.5)});
  const double both = massNear(last, kMatches[0]) + massNear(last, kMatches[1]);
  result.findings.push_back(
      {"all pixels looked at, two of them match", "two significant candidates",
       text("%.1f %% of the probability at the two", 100.0 * both), verdict(both > 0.9)});
  const double single_bits = bitsLost(last, single), mixture_bits = bitsLost(last, mixture);
  result.findings.push_back({"bits lost by a model of the final distribution",
                             "a mixture of Gaussians represents it well, one Gaussian does not",
                             text("mixture %.2f, one Gaussian %.2f", mixture_bits, single_bits),
                             verdict(mixture_bits < 0.2 * single_bits)});
  return result;
}

}  // namespace active_matching_slam
