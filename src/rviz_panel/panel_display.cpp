// The half of the panel that shows what is known of the tracker.

#include <QAbstractItemView>
#include <QComboBox>
#include <QGridLayout>
#include <QGroupBox>
#include <QLabel>
#include <QProgressBar>
#include <QPushButton>
#include <QSignalBlocker>
#include <cmath>

#include "active_matching_slam/rviz_panel/report_text.h"
#include "active_matching_slam/rviz_panel/tracker_panel.h"

namespace active_matching_slam {
namespace {

const char* const kDrawPrefix = "draw/";

void setText(QLabel* label, const QString& text) {
  if (label->text() != text) label->setText(text);
}

}  // namespace

void TrackerPanel::refresh() {
  const TrackerReport report = link_.report();
  offerTrackers(report);
  showStatus(report);
  showNumbers(report);
  showParameters(report);
  showAnswer(report);
}

void TrackerPanel::offerTrackers(const TrackerReport& report) {
  if (offered_ == report.others || name_->view()->isVisible()) return;
  offered_ = report.others;
  const QSignalBlocker quiet(name_);
  const QString text = name_->currentText();
  name_->clear();
  for (const std::string& other : offered_) name_->addItem(QString::fromStdString(other));
  name_->setEditText(text);
}

void TrackerPanel::showStatus(const TrackerReport& report) {
  const StateText text = stateText(report, name_->currentText());
  setText(badge_, text.name);
  setBadgeColor(text.color);
  setText(reason_, text.reason);
  reason_->setVisible(!text.reason.isEmpty());
  quality_->setEnabled(text.quality.has_value());
  quality_->setValue(static_cast<int>(std::lround(100.0 * text.quality.value_or(0.0))));
  quality_->setFormat(text.quality ? QString("quality %1").arg(*text.quality, 0, 'f', 2)
                                   : QString("quality -"));
  for (QPushButton* button : buttons_) button->setEnabled(report.is_there);
}

void TrackerPanel::setBadgeColor(const char* color) {
  const QString style = QString(
                            "QLabel { background: %1; color: white; font-weight: bold; "
                            "border-radius: 3px; padding: 3px 8px; }")
                            .arg(color);
  if (badge_->styleSheet() != style) badge_->setStyleSheet(style);
}

void TrackerPanel::showNumbers(const TrackerReport& report) {
  setText(scale_, scaleText(report));
  setText(map_, mapText(report));
  setText(matches_, imageText(report));
  const QString laid_aside = laidAsideText(report);
  setText(laid_aside_, laid_aside);
  for (QLabel* label : {laid_aside_title_, laid_aside_}) label->setVisible(!laid_aside.isEmpty());
  setText(submaps_text_, hierarchyText(report, submaps_->isChecked()));
}

void TrackerPanel::showParameters(const TrackerReport& report) {
  const auto values = report.is_there ? report.values : nullptr;
  const auto description = report.is_there ? report.description : nullptr;
  if (shows_parameters_ && values == shown_values_ && description == shown_description_) return;
  shows_parameters_ = true;
  shown_values_ = values;
  shown_description_ = description;
  for (const auto& field : fields_) field->show(description.get(), values.get());
  showToggles(report);
}

/// One for every parameter of drawing that is on or off, whichever the tracker has.
void TrackerPanel::showToggles(const TrackerReport& report) {
  const auto* values = shown_values_.get();
  std::vector<std::string> names;
  if (values)
    for (const auto& entry : values->bools)
      if (entry.name.rfind(kDrawPrefix, 0) == 0) names.push_back(entry.name);
  if (report.is_there && names != toggle_names_) {
    toggle_names_ = names;
    for (const auto& toggle : toggles_) toggle->widget()->deleteLater();
    toggles_.clear();
    for (const std::string& name : names) {
      const QString label =
          QString::fromStdString(name.substr(std::string(kDrawPrefix).size())).replace('_', ' ');
      const int at = static_cast<int>(toggles_.size());
      toggles_.push_back(
          std::make_unique<ParameterField>(name, ParameterField::Kind::kToggle, label, drawing_,
                                           [this](const std::string& parameter, const auto& value) {
                                             link_.setParameter(parameter, value);
                                           }));
      toggle_grid_->addWidget(toggles_.back()->widget(), at / 2, at % 2);
    }
  }
  for (const auto& toggle : toggles_) toggle->show(shown_description_.get(), values);
}

void TrackerPanel::showAnswer(const TrackerReport& report) {
  QString text = QString::fromStdString(report.answer);
  bool is_fault = report.is_refused;
  // Sooner it would flicker.
  if (!report.pending.empty() && report.pending_s > 1.0) {
    text = QString("%1: no answer for %2 s")
               .arg(QString::fromStdString(report.pending))
               .arg(std::floor(report.pending_s), 0, 'f', 0);
    is_fault = true;
  }
  setText(answer_, text);
  answer_->setVisible(!text.isEmpty());
  const QString style = is_fault ? "QLabel { color: #c62828; }" : "";
  if (answer_->styleSheet() != style) answer_->setStyleSheet(style);
}

}  // namespace active_matching_slam
