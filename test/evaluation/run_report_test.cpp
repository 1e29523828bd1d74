#include "active_matching_slam/evaluation/run_report.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "active_matching_slam/evaluation/text_file.h"
#include "evaluation/test_trajectories.h"
#include "support/fault.h"

namespace active_matching_slam {
namespace {

using Json = nlohmann::json;

std::string contentOf(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// Cells of a table by row and column name; knows nothing of quotes.
std::vector<std::map<std::string, std::string>> parseCsv(const std::string& text) {
  std::vector<std::map<std::string, std::string>> rows;
  std::vector<std::string> names;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::vector<std::string> cells;
    std::istringstream stream(line + ",");
    for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
    if (names.empty()) {
      names = cells;
      continue;
    }
    EXPECT_EQ(cells.size(), names.size()) << line;
    rows.emplace_back();
    for (std::size_t i = 0; i < cells.size(); ++i) rows.back()[names[i]] = cells[i];
  }
  return rows;
}

/// 90 frames along the truth in another world and at another scale, of which ten were lost.
class Run : public testing::Test {
 protected:
  Run() { std::filesystem::create_directories(directory_); }
  ~Run() override { std::filesystem::remove_all(directory_); }

  TrackedFrame frameAt(int i) const {
    TrackedFrame frame;
    frame.index = i;
    frame.image = cv::Mat(1, 1, CV_8UC1, cv::Scalar(0));
    frame.stamp_s = estimate_[i].stamp_s;
    frame.state = i >= 40 && i < 50 ? TrackingState::kLost : TrackingState::kTracking;
    frame.reason = i == 40 ? "too few matches, 3 of \"4\"" : "";
    frame.times_lost = i >= 40 ? 1 : 0;
    frame.camera.position_world = estimate_[i].T_world_camera.translation();
    frame.camera.q_world_camera = Eigen::Quaterniond(estimate_[i].T_world_camera.linear());
    frame.camera.readout_s = 1e-3 * i;
    frame.match_sigma_px = 0.01 * i;
    frame.camera.lens.centre.y() = -1e-4 * i;
    frame.camera_covariance.setIdentity();
    frame.matching.statistics.matcher = "active";
    frame.matching.statistics.candidates = 12;
    frame.matching.statistics.matched = i % 2 ? 10 : 11;
    frame.matching.statistics.pixels_searched = 100;
    frame.matching.statistics.pixels_full_gates = 700;
    frame.matching.statistics.cut_short = i == 7;
    frame.timings_ms.match = i;
    frame.timings_ms.total = 2.0 * i;
    frame.features_started = i == 0 ? 12 : 0;
    TrackedFeature feature;
    feature.id = 5;
    feature.kind = FeatureKind::kPoint;
    feature.position_world = Eigen::Vector3d(0.0, 0.0, 1.0 + i);
    feature.status = FeatureStatus::kMissed;
    frame.features.push_back(feature);
    return frame;
  }
  RunReport report(bool with_truth) const {
    RunReport report;
    for (int i = 0; i < 90; ++i) report.add(frameAt(i));
    if (with_truth) report.setTruth({truth_, false, 0.02});
    return report;
  }

  const Trajectory truth_ = randomTrajectory(90);
  const Trajectory estimate_ = transformed(truth_, 0.5, someRotation(), {1.0, 2.0, 3.0});
  const std::string directory_ = temporaryPath("run");
};

TEST_F(Run, TheSummaryCountsFramesAndMatches) {
  const RunSummary s = report(false).summary();
  EXPECT_EQ(s.frames, 90);
  EXPECT_EQ(s.frames_tracked, 80);
  EXPECT_EQ(s.times_lost, 1);
  EXPECT_EQ(s.matcher, "active");
  EXPECT_NEAR(s.matched_mean, 10.5, 1e-12);
  EXPECT_EQ(s.pixels_full_gates, 63000);
  EXPECT_EQ(s.cut_short_frames, 1);
  EXPECT_EQ(s.started, 12);
  EXPECT_EQ(s.map_features_end, 1);
}

TEST_F(Run, ErrorsAreTakenOverTheTrackedFramesAfterAlignment) {
  const RunSummary s = report(true).summary();
  EXPECT_EQ(s.truth_pairs, 80);
  EXPECT_NEAR(*s.sim3_scale, 2.0, 1e-9);
  EXPECT_LT(*s.ate_sim3_m, 1e-9);
  EXPECT_GT(*s.ate_se3_m, 0.05);
  EXPECT_LT(s.rpe->translation_rmse, 1e-9);
}

TEST_F(Run, WithoutTruthTheErrorsAreNull) {
  const Json json = Json::parse(summaryJson(report(false).summary()));
  for (const char* key : {"ate_sim3_m", "ate_se3_m", "rpe_m", "nees_mean", "sim3_scale"}) {
    ASSERT_TRUE(json.contains(key)) << key;
    EXPECT_TRUE(json[key].is_null()) << key;
  }
}

TEST_F(Run, TheJsonHasEveryKeyThatScriptsRead) {
  const Json json = Json::parse(summaryJson(report(true).summary()));
  EXPECT_EQ(json["frames"], 90);
  EXPECT_EQ(json["frames_tracked"], 80);
  EXPECT_EQ(json["times_lost"], 1);
  EXPECT_EQ(json["scale_source"], "free");
  EXPECT_NEAR(json["pixels_ratio"].get<double>(), 7.0, 1e-12);
  for (const char* stage : {"predict", "measure", "match", "update", "map", "structure", "total"}) {
    EXPECT_TRUE(json["ms"][stage]["median"].is_number()) << stage;
    EXPECT_TRUE(json["ms"][stage]["p99"].is_number()) << stage;
  }
  EXPECT_EQ(json["ms"]["total"]["median"], 88.0);
  EXPECT_EQ(json["ms"]["total"]["p99"], 178.0);
  EXPECT_TRUE(json["nees_mean"].is_null());
}

TEST_F(Run, AnEmptyRunHasASummaryToo) {
  const Json json = Json::parse(summaryJson(RunReport().summary()));
  EXPECT_EQ(json["frames"], 0);
  EXPECT_TRUE(json["matcher"].is_null());
  EXPECT_TRUE(json["pixels_ratio"].is_null());
}

TEST_F(Run, SimulatedTruthGivesTheNeesInTheWorldOfTheMap) {
  RunReport metric;
  std::vector<double> expected;
  for (int i = 0; i < 90; ++i) {
    TrackedFrame frame = frameAt(i);
    frame.scale_source = ScaleSource::kKnownTarget;
    const double off = 0.01 * i;
    frame.camera.position_world =
        truth_[i].T_world_camera.translation() + Eigen::Vector3d(off, 0, 0);
    frame.camera.q_world_camera = Eigen::Quaterniond(truth_[i].T_world_camera.linear());
    frame.camera_covariance *= 1e-4;
    metric.add(frame);
    if (frame.state == TrackingState::kTracking) expected.push_back(off * off / 1e-4);
  }
  metric.setTruth({truth_, true, 0.02});
  double sum = 0.0;
  for (double nees : expected) sum += nees;
  EXPECT_NEAR(*metric.summary().nees_mean, sum / expected.size(), 1e-6);
  const FrameErrors errors = frameErrors(metric.records(), metric.truth());
  EXPECT_NEAR(errors.pose_nees[20], 0.2 * 0.2 / 1e-4, 1e-6);
  EXPECT_TRUE(std::isnan(errors.pose_nees[45]));  // lost
}

TEST_F(Run, AFreeScaleRunWithoutErrorHasNoNees) {
  // The map's world and scale are a gauge, not an error.
  RunReport free = report(false);
  free.setTruth({truth_, true, 0.02});
  EXPECT_LT(*free.summary().nees_mean, 1e-9);
}

TEST_F(Run, StatisticsHaveOneRowAFrameAndUnitsInTheirNames) {
  RunReport without_reason;
  for (int i = 0; i < 40; ++i) without_reason.add(frameAt(i));
  without_reason.setTruth({truth_, false, 0.02});
  const auto rows = parseCsv(without_reason.statisticsCsv());
  ASSERT_EQ(rows.size(), 40u);
  EXPECT_EQ(std::stod(rows[3].at("stamp_s")), estimate_[3].stamp_s);
  EXPECT_EQ(rows[3].at("state"), "tracking");
  EXPECT_EQ(rows[3].at("matcher"), "active");
  EXPECT_EQ(rows[3].at("matched"), "10");
  EXPECT_EQ(rows[3].at("missed"), "1");
  EXPECT_EQ(rows[7].at("cut_short"), "1");
  EXPECT_EQ(rows[7].at("total_ms"), "14");
  EXPECT_EQ(std::stod(rows[7].at("readout_s")), 7e-3);
  EXPECT_EQ(std::stod(rows[7].at("match_sigma_px")), 0.07);
  EXPECT_EQ(std::stod(rows[7].at("lens_centre_y")), -7e-4);
  EXPECT_EQ(std::stod(rows[7].at("lens_focal")), 0.0);
  EXPECT_EQ(rows[7].at("pose_nees"), "");  // not simulated
  EXPECT_LT(std::stod(rows[7].at("position_error_m")), 1e-9);
}

TEST_F(Run, SubmapsThatWereLaidAsideAreListed) {
  RunReport plain = report(true), with_submaps = report(true);
  TrackedFrame last = frameAt(89);
  auto frozen = std::make_shared<FrozenMap>();
  frozen->leaves = {{3, 21, 10, 2.5}, {7, 40, 8, 0.125}};
  last.frozen = frozen;
  with_submaps.add(last);
  plain.write(directory_);
  EXPECT_FALSE(std::filesystem::exists(directory_ + "/frozen_submaps.csv"));
  with_submaps.write(directory_);
  EXPECT_EQ(contentOf(directory_ + "/frozen_submaps.csv"),
            "id,features,separators,lost_bits\n3,21,10,2.5\n7,40,8,0.125\n");
}

TEST_F(Run, AReasonWithCommasAndQuotesStaysOneCell) {
  EXPECT_NE(report(false).statisticsCsv().find(",\"too few matches, 3 of \"\"4\"\"\","),
            std::string::npos);
}

TEST_F(Run, DurationsStandInTheirOwnColumnsAlone) {
  RunReport slow;
  for (int i = 0; i < 90; ++i) {
    TrackedFrame frame = frameAt(i);
    frame.timings_ms.total += 17.0;
    frame.matching.statistics.information_ms = 3.0;
    slow.add(frame);
  }
  std::string fast_text = report(false).statisticsCsv(), slow_text = slow.statisticsCsv();
  const std::string quoted = "\"too few matches, 3 of \"\"4\"\"\"";
  for (std::string* text : {&fast_text, &slow_text})
    text->replace(text->find(quoted), quoted.size(), "reason");
  auto fast_rows = parseCsv(fast_text), slow_rows = parseCsv(slow_text);
  EXPECT_NE(fast_rows, slow_rows);
  for (auto* rows : {&fast_rows, &slow_rows})
    for (auto& row : *rows)
      for (auto& [name, cell] : row)
        if (name.size() > 3 && name.substr(name.size() - 3) == "_ms") cell.clear();
  EXPECT_EQ(fast_rows, slow_rows);
}

TEST_F(Run, EveryFileIsWrittenAndTheTrajectoryHasOneLineForEachFrameTracked) {
  report(true).write(directory_);
  EXPECT_EQ(readTrajectoryTum(directory_ + "/trajectory.txt").size(), 80u);
  EXPECT_EQ(Json::parse(contentOf(directory_ + "/summary.json"))["frames"], 90);
  EXPECT_FALSE(contentOf(directory_ + "/statistics.csv").empty());
  EXPECT_FALSE(cv::imread(directory_ + "/trajectory.png").empty());
}

TEST_F(Run, AFailedWriteNamesTheFile) {
  const std::string fault = faultOf([&] { report(true).write(directory_ + "/missing"); });
  EXPECT_NE(fault.find(directory_ + "/missing/statistics.csv"), std::string::npos) << fault;
  EXPECT_NE(faultOf([] { writeTextFile("/dev/full", std::string(100000, 'x')); }).find("/dev/full"),
            std::string::npos);
}

TEST(Percentile, IsTheNearestRank) {
  EXPECT_EQ(percentile({}, 0.5), 0.0);
  EXPECT_EQ(percentile({3.0}, 0.99), 3.0);
  EXPECT_EQ(percentile({4.0, 1.0, 3.0, 2.0}, 0.5), 2.0);
  EXPECT_EQ(percentile({4.0, 1.0, 3.0, 2.0}, 0.99), 4.0);
}

TEST(NumberText, ReadsBackBitForBitAndIsShort) {
  EXPECT_EQ(numberText(0.1), "0.1");
  EXPECT_EQ(numberText(0.033333), "0.033333");
  EXPECT_EQ(numberText(-0.0 / 0.0), "nan");
  for (const double value : {1.0 / 3.0, 1e-300, 6.02214076e23, -2.0 / 7.0})
    EXPECT_EQ(std::stod(numberText(value)), value);
}

}  // namespace
}  // namespace active_matching_slam
