#pragma once

#include <string>
#include <vector>

#include "workbench.h"

namespace active_matching_slam {

using CellValue = double (*)(const TrialSummary&);

/// One line a matcher over the number of features, at one rate.
cv::Mat chartByFeatures(Workbench& bench, const std::string& title, const std::string& y_label,
                        double rate_hz, const std::vector<std::string>& matchers, CellValue value,
                        bool log_y = false);
/// One line a matcher over the frame rate, with one number of features.
cv::Mat chartByRate(Workbench& bench, const std::string& title, const std::string& y_label,
                    int features, const std::vector<std::string>& matchers, CellValue value,
                    bool log_y = false);
/// Where a matcher's time goes, one bar a number of features or a rate. All of the main sequence.
cv::Mat timesByFeatures(Workbench& bench, const std::string& matcher, double rate_hz);
cv::Mat timesByRate(Workbench& bench, const std::string& matcher, int features);

/// value(a) / value(b) of the main sequence by rate, fastest first, where both are known.
std::vector<double> ratiosByRate(Workbench& bench, int features, const std::string& a,
                                 const std::string& b, CellValue value);
/// "30 Hz 4.1, 15 Hz 5.0"
std::string byRateText(Workbench& bench, const std::vector<double>& values, const char* format);

bool isRising(const std::vector<double>& values);

inline double pixelsOf(const TrialSummary& s) { return s.pixels; }
inline double spuriousOf(const TrialSummary& s) { return s.spurious; }
inline double totalOf(const TrialSummary& s) { return s.total_ms; }

}  // namespace active_matching_slam
