// What a user does with the panel, beside a tracker at /tracker that is fed a film without end.
//
//   panel_clicks [--picture FILE]    --picture: waits until the tracker tracks, and saves a picture
#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <ros/spinner.h>
#include <rviz/config.h>
#include <rviz/panel.h>
#include <std_srvs/Trigger.h>

#include <QApplication>
#include <QCheckBox>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QLabel>
#include <QLineEdit>
#include <QPushButton>
#include <QtTest/QtTest>
#include <future>
#include <memory>
#include <pluginlib/class_loader.hpp>

#include "active_matching_slam/ros/messages.h"

namespace {

/// The user's patience.
constexpr int kPatience_ms = 60000;

pluginlib::ClassLoader<rviz::Panel>& loader() {
  // Never destroyed: at the end of main() its library would go before what uses it.
  static auto* loader = new pluginlib::ClassLoader<rviz::Panel>("rviz", "rviz::Panel");
  return *loader;
}

class PanelTest : public testing::Test {
 protected:
  PanelTest() : panel_(loader().createUniqueInstance("active_matching_slam/TrackerPanel")) {
    panel_->show();
  }

  template <class Widget>
  Widget* find(const char* name) {
    auto* widget = panel_->findChild<Widget*>(name);
    if (!widget) throw std::runtime_error(std::string("no widget ") + name);
    return widget;
  }
  std::string text(const char* name) { return find<QLabel>(name)->text().toStdString(); }
  void choose(const std::string& tracker) {
    auto* line = find<QComboBox>("tracker")->lineEdit();
    line->selectAll();
    QTest::keyClicks(line, QString::fromStdString(tracker));
    QTest::keyClick(line, Qt::Key_Return);
  }
  void click(const char* name) {
    auto* button = find<QAbstractButton>(name);
    ASSERT_TRUE(QTest::qWaitFor([&] { return button->isEnabled(); }, kPatience_ms)) << name;
    button->click();
  }
  /// Waits, with the panel alive, for a label to hold a text.
  testing::AssertionResult says(const char* name, const std::string& words) {
    if (QTest::qWaitFor([&] { return text(name).find(words) != std::string::npos; }, kPatience_ms))
      return testing::AssertionSuccess();
    return testing::AssertionFailure() << name << " says '" << text(name) << "', not " << words;
  }
  void waitUntilTracking() { ASSERT_TRUE(says("state", "TRACKING")); }

  std::unique_ptr<rviz::Panel, std::function<void(rviz::Panel*)>> panel_;
};

/// A tracker that takes calls and answers them when told to.
class StoppedTracker {
 public:
  explicit StoppedTracker(const std::string& name) : node_(name), spinner_(1, &queue_) {
    node_.setCallbackQueue(&queue_);
    state_ = node_.advertise<ams_msgs::TrackingState>("state", 1, true);
    statistics_ = node_.advertise<ams_msgs::MatchingStatistics>("statistics", 1, true);
    service_ = node_.advertiseService<std_srvs::Trigger::Request, std_srvs::Trigger::Response>(
        "reset", [this](auto&, auto& response) {
          called_.set_value();
          may_answer_.get_future().wait();
          response.success = true;
          response.message = "at last";
          return true;
        });
    spinner_.start();
  }
  ~StoppedTracker() { spinner_.stop(); }
  bool wasCalled() {
    return future_.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  }
  void answer() { may_answer_.set_value(); }
  void tell(const ams_msgs::TrackingState& state, const ams_msgs::MatchingStatistics& statistics) {
    state_.publish(state);
    statistics_.publish(statistics);
  }

 private:
  std::promise<void> called_, may_answer_;
  std::future<void> future_ = called_.get_future();
  ros::CallbackQueue queue_;
  ros::NodeHandle node_;
  ros::AsyncSpinner spinner_;
  ros::Publisher state_, statistics_;
  ros::ServiceServer service_;
};

TEST_F(PanelTest, ShowsHowALiveTrackerDoes) {
  waitUntilTracking();
  EXPECT_TRUE(says("scale", "free"));
  EXPECT_TRUE(says("map", "features"));
  EXPECT_TRUE(says("matches", "matched by"));
  EXPECT_TRUE(says("submaps_text", "submaps of"));
}

TEST_F(PanelTest, SaysThatThereIsNoTrackerAndNamesOneThatIs) {
  choose("/nobody");
  EXPECT_TRUE(says("reason", "no tracker at /nobody"));
  EXPECT_TRUE(says("reason", "there is one at /tracker"));
  EXPECT_EQ("NO TRACKER", text("state"));
  EXPECT_FALSE(find<QPushButton>("reset")->isEnabled());
  EXPECT_FALSE(find<QComboBox>("matcher")->isEnabled());
  choose("/tracker");
  waitUntilTracking();
}

TEST_F(PanelTest, SaysThatANameIsNone) {
  choose("/not a name");
  EXPECT_TRUE(says("reason", "no name"));
}

TEST_F(PanelTest, TheMatcherIsChosen) {
  auto* matcher = find<QComboBox>("matcher");
  for (const char* name : {"jcbb", "auto"}) {
    ASSERT_TRUE(QTest::qWaitFor([&] { return matcher->isEnabled(); }, kPatience_ms));
    matcher->setCurrentText(name);
    EXPECT_TRUE(says("answer", std::string("matcher is ") + name));
    std::string now;
    ros::param::get("/tracker/matcher", now);
    EXPECT_EQ(name, now);
  }
}

TEST_F(PanelTest, NumbersAndTogglesReachTheTracker) {
  auto* number = find<QDoubleSpinBox>("map/features_per_frame");
  ASSERT_TRUE(QTest::qWaitFor([&] { return number->isEnabled(); }, kPatience_ms));
  const double before = number->value();
  number->setValue(before + 7);
  EXPECT_TRUE(says("answer", "map/features_per_frame is " + std::to_string(int(before) + 7)));
  int now = 0;
  ros::param::get("/tracker/map/features_per_frame", now);
  EXPECT_EQ(int(before) + 7, now);
  number->setValue(before);
  EXPECT_TRUE(says("answer", "map/features_per_frame is " + std::to_string(int(before))));

  auto* toggle = find<QCheckBox>("draw/templates");
  const bool was_on = toggle->isChecked();
  toggle->click();
  EXPECT_TRUE(says("answer", std::string("draw/templates is ") + (was_on ? "false" : "true")));
  toggle->click();
  EXPECT_TRUE(says("answer", std::string("draw/templates is ") + (was_on ? "true" : "false")));
}

TEST_F(PanelTest, WhatOthersChangeIsShown) {
  auto* toggle = find<QAbstractButton>("save");
  ASSERT_TRUE(QTest::qWaitFor([&] { return toggle->isEnabled(); }, kPatience_ms));
  ros::NodeHandle node;
  ams_msgs::SetMatcher service;
  auto* matcher = find<QComboBox>("matcher");
  for (const char* name : {"active", "auto"}) {
    service.request.name = name;
    ASSERT_TRUE(ros::service::call("/tracker/set_matcher", service));
    EXPECT_TRUE(QTest::qWaitFor([&] { return matcher->currentText() == name; }, kPatience_ms))
        << matcher->currentText().toStdString();
  }
}

TEST_F(PanelTest, AParameterThatTheTrackerHasNotIsGrey) {
  choose("/fake");
  StoppedTracker tracker("/fake");
  EXPECT_TRUE(says("reason", "no image"));
  EXPECT_FALSE(find<QDoubleSpinBox>("map/features_per_frame")->isEnabled());
  tracker.answer();
}

TEST_F(PanelTest, SubmapsThatAreLaidAsideAreCountedWhereThereAreAny) {
  choose("/fake");
  StoppedTracker tracker("/fake");
  ams_msgs::TrackingState state;
  state.state = ams_msgs::TrackingState::TRACKING;
  state.state_name = "tracking";
  ams_msgs::MatchingStatistics statistics;
  statistics.features = 80;
  tracker.tell(state, statistics);
  EXPECT_TRUE(says("map", "80 features"));
  EXPECT_FALSE(find<QLabel>("laid_aside")->isVisible());
  statistics.submaps = 4;
  statistics.frozen_features = 130;
  statistics.trunk_features = 31;
  statistics.submaps_found = 2;
  statistics.loops = 1;
  statistics.submap_lost_bits = 57.4;
  tracker.tell(state, statistics);
  EXPECT_TRUE(says("laid_aside", "4 submaps: 130 features, of which 31 separators; 57 bit"));
  EXPECT_TRUE(says("laid_aside", "2 found again; 1 loop"));
  EXPECT_TRUE(find<QLabel>("laid_aside")->isVisible());
  tracker.answer();
}

TEST_F(PanelTest, AMapIsSavedAndLoadedAndAWrongNameIsRefused) {
  waitUntilTracking();
  find<QLineEdit>("file")->setText("panel_test.map");
  click("save");
  EXPECT_TRUE(says("answer", "save map: /"));
  const std::string path = text("answer").substr(std::string("save map: ").size());
  click("load");
  EXPECT_TRUE(says("answer", "load map: " + path));
  find<QLineEdit>("file")->setText("../elsewhere.map");
  click("save");
  EXPECT_TRUE(says("answer", "save map refused"));
  std::remove(path.c_str());
}

TEST_F(PanelTest, TheMapIsReset) {
  waitUntilTracking();
  click("reset");
  EXPECT_TRUE(says("answer", "reset: the next image starts anew"));
}

TEST_F(PanelTest, TheScaleIsSetAndItsSourceShown) {
  waitUntilTracking();
  find<QDoubleSpinBox>("factor")->setValue(2.0);
  click("set_scale");
  EXPECT_TRUE(says("answer", "multiplied by 2"));
  EXPECT_TRUE(says("scale", "from service"));
  click("reset");
  EXPECT_TRUE(says("scale", "free"));
}

// Were the panel to wait for the answer, this test would never end.
TEST_F(PanelTest, ATrackerThatDoesNotAnswerFreezesNothing) {
  StoppedTracker tracker("/stopped");
  choose("/stopped");
  EXPECT_TRUE(says("reason", "no image"));
  click("reset");
  EXPECT_TRUE(QTest::qWaitFor([&] { return tracker.wasCalled(); }, kPatience_ms));
  EXPECT_TRUE(says("answer", "reset: no answer for"));
  choose("/tracker");
  waitUntilTracking();
  tracker.answer();
}

TEST_F(PanelTest, APanelMayEndWhileACallIsOpen) {
  StoppedTracker tracker("/stopped");
  choose("/stopped");
  EXPECT_TRUE(says("reason", "no image"));
  click("reset");
  EXPECT_TRUE(QTest::qWaitFor([&] { return tracker.wasCalled(); }, kPatience_ms));
  panel_.reset();
  tracker.answer();
}

TEST_F(PanelTest, ATrackerThatDiesIsMissedAndOneThatComesIsFound) {
  choose("/fake");
  auto tracker = std::make_unique<StoppedTracker>("/fake");
  EXPECT_TRUE(says("reason", "no image"));
  tracker->answer();
  tracker.reset();
  EXPECT_TRUE(says("reason", "no tracker at /fake"));
  tracker = std::make_unique<StoppedTracker>("/fake");
  EXPECT_TRUE(says("reason", "no image"));
  tracker->answer();
}

TEST_F(PanelTest, TheNameIsSavedInTheConfiguration) {
  choose("/left");
  rviz::Config config;
  panel_->save(config);
  const auto other = loader().createUniqueInstance("active_matching_slam/TrackerPanel");
  other->load(config);
  EXPECT_EQ("/left", other->findChild<QComboBox*>("tracker")->currentText().toStdString());
  const auto* reason = other->findChild<QLabel*>("reason");
  EXPECT_TRUE(QTest::qWaitFor([&] { return reason->text().contains("no tracker at /left"); },
                              kPatience_ms));
}

bool takePicture(const char* file) {
  const auto panel = loader().createUniqueInstance("active_matching_slam/TrackerPanel");
  panel->resize(panel->sizeHint());
  panel->show();
  const auto* state = panel->findChild<QLabel*>("state");
  const auto* submaps = panel->findChild<QLabel*>("submaps_text");
  const bool is_ready = QTest::qWaitFor(
      [&] { return state->text() == "TRACKING" && submaps->text().contains("submaps"); },
      kPatience_ms);
  return panel->grab().save(file) && is_ready;
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  QApplication application(argc, argv);
  ros::init(argc, argv, "panel_clicks", ros::init_options::AnonymousName);
  const ros::NodeHandle node;  // ROS ends with the last one
  int status = 0;
  if (argc == 3 && std::string(argv[1]) == "--picture")
    status = takePicture(argv[2]) ? 0 : 1;
  else
    status = RUN_ALL_TESTS();
  ros::shutdown();
  return status;
}
