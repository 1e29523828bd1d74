#pragma once

#include <QString>
#include <QWidget>
#include <functional>
#include <string>

#include "active_matching_slam/rviz_panel/tracker_link.h"

class QCheckBox;
class QComboBox;
class QDoubleSpinBox;

namespace active_matching_slam {

/// A widget for one parameter of dynamic_reconfigure, by name: with the range and the help that the
/// tracker tells at run time, and grey where it has no such parameter.
class ParameterField {
 public:
  /// `send` is called when the user has chosen a value.
  using Send = std::function<void(const std::string& name, const TrackerLink::Value& value)>;

  enum class Kind { kNumber, kToggle, kChoice };
  /// The widget belongs to `parent` and is named as the parameter; `label` stands on a toggle.
  ParameterField(const std::string& name, Kind kind, const QString& label, QWidget* parent,
                 Send send);

  const std::string& name() const { return name_; }
  QWidget* widget() const { return widget_; }
  void setChoices(const std::vector<std::string>& choices);
  /// Shows the value without sending it. Null pointers: nothing is known of the tracker.
  void show(const dynamic_reconfigure::ConfigDescription* description,
            const dynamic_reconfigure::Config* values);

 private:
  void makeNumber(QWidget* parent);
  void makeToggle(const QString& label, QWidget* parent);
  void makeChoice(QWidget* parent);
  void describe(const dynamic_reconfigure::ConfigDescription& description);
  void showValue(const TrackerLink::Value& value);

  std::string name_;
  Send send_;
  QWidget* widget_ = nullptr;
  QDoubleSpinBox* number_ = nullptr;  ///< one of these three
  QCheckBox* toggle_ = nullptr;
  QComboBox* choice_ = nullptr;
  bool is_whole_ = false;
};

}  // namespace active_matching_slam
