#pragma once

#include <rviz/panel.h>

#include <memory>
#include <vector>

#include "active_matching_slam/rviz_panel/parameter_field.h"
#include "active_matching_slam/rviz_panel/tracker_link.h"

class QBoxLayout;
class QCheckBox;
class QComboBox;
class QDoubleSpinBox;
class QGridLayout;
class QGroupBox;
class QLabel;
class QLineEdit;
class QProgressBar;
class QPushButton;
class QTimer;

namespace active_matching_slam {

/// A panel of rviz: how a tracker does, and what it can be asked for. Its name, what map file was
/// named last and whether submaps are listened to are saved in rviz's configuration.
///
/// What is asked for is in tracker_panel.cpp, what is shown in panel_display.cpp, in the words of
/// report_text.h. Whatever waits for ROS does so in TrackerLink's threads; the panel looks at its
/// report.
class TrackerPanel : public rviz::Panel {
  Q_OBJECT
 public:
  explicit TrackerPanel(QWidget* parent = nullptr);
  ~TrackerPanel() override;

  void load(const rviz::Config& config) override;
  void save(rviz::Config config) const override;
  QSize sizeHint() const override;

 private:
  void addStatus(QBoxLayout* column);
  void addMatching(QBoxLayout* column);
  void addMap(QBoxLayout* column);
  void addSubmaps(QBoxLayout* column);
  void addDrawing(QBoxLayout* column);
  QPushButton* addButton(const QString& name, const QString& text, const QString& help,
                         QBoxLayout* row);
  QLabel* addLine(const QString& name, QBoxLayout* column);
  ParameterField* addField(const std::string& name, ParameterField::Kind kind, const QString& label,
                           QWidget* parent);

  void chooseTracker();
  /// Ten times a second.
  void refresh();
  void showStatus(const TrackerReport& report);
  void setBadgeColor(const char* color);
  void showNumbers(const TrackerReport& report);
  void showParameters(const TrackerReport& report);
  void showToggles(const TrackerReport& report);
  void showAnswer(const TrackerReport& report);
  void offerTrackers(const TrackerReport& report);

  TrackerLink link_;
  std::vector<std::unique_ptr<ParameterField>> fields_, toggles_;
  std::vector<std::string> toggle_names_, offered_;
  dynamic_reconfigure::ConfigConstPtr shown_values_;
  dynamic_reconfigure::ConfigDescriptionConstPtr shown_description_;
  bool shows_parameters_ = false;

  QTimer* timer_ = nullptr;
  QComboBox* name_ = nullptr;
  QLabel *badge_ = nullptr, *reason_ = nullptr, *scale_ = nullptr, *map_ = nullptr,
         *matches_ = nullptr, *laid_aside_title_ = nullptr, *laid_aside_ = nullptr,
         *submaps_text_ = nullptr, *answer_ = nullptr;
  QProgressBar* quality_ = nullptr;
  QLineEdit* file_ = nullptr;
  QDoubleSpinBox* factor_ = nullptr;
  QGroupBox *submaps_ = nullptr, *drawing_ = nullptr;
  QGridLayout* toggle_grid_ = nullptr;
  std::vector<QPushButton*> buttons_;
};

}  // namespace active_matching_slam
