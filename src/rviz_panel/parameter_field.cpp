#include "active_matching_slam/rviz_panel/parameter_field.h"

#include <QCheckBox>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QSignalBlocker>
#include <algorithm>

namespace active_matching_slam {
namespace {

/// Of a fraction. Cost: the width of the widget.
constexpr int kDecimals = 4;

double toNumber(const TrackerLink::Value& value) {
  if (const auto* i = std::get_if<int>(&value)) return *i;
  if (const auto* d = std::get_if<double>(&value)) return *d;
  if (const auto* b = std::get_if<bool>(&value)) return *b ? 1.0 : 0.0;
  return 0.0;
}

const dynamic_reconfigure::ParamDescription* findDescription(
    const dynamic_reconfigure::ConfigDescription& description, const std::string& name) {
  for (const auto& group : description.groups)
    for (const auto& parameter : group.parameters)
      if (parameter.name == name) return &parameter;
  return nullptr;
}

/// Two decimals are shown of 0.25, none of 20.
class PlainSpinBox : public QDoubleSpinBox {
 public:
  using QDoubleSpinBox::QDoubleSpinBox;
  QString textFromValue(double value) const override { return locale().toString(value, 'g', 6); }
};

}  // namespace

ParameterField::ParameterField(const std::string& name, Kind kind, const QString& label,
                               QWidget* parent, Send send)
    : name_(name), send_(std::move(send)) {
  if (kind == Kind::kNumber) makeNumber(parent);
  if (kind == Kind::kToggle) makeToggle(label, parent);
  if (kind == Kind::kChoice) makeChoice(parent);
  widget_->setObjectName(QString::fromStdString(name));
  show(nullptr, nullptr);
}

void ParameterField::makeNumber(QWidget* parent) {
  widget_ = number_ = new PlainSpinBox(parent);
  number_->setLocale(QLocale::c());
  number_->setKeyboardTracking(false);  // sent when it stands, not with each digit
  number_->setStepType(QAbstractSpinBox::AdaptiveDecimalStepType);
  number_->setMinimumWidth(0);
  QObject::connect(number_, QOverload<double>::of(&QDoubleSpinBox::valueChanged), number_,
                   [this](double value) {
                     if (is_whole_)
                       send_(name_, static_cast<int>(value));
                     else
                       send_(name_, value);
                   });
}

void ParameterField::makeToggle(const QString& label, QWidget* parent) {
  widget_ = toggle_ = new QCheckBox(label, parent);
  QObject::connect(toggle_, &QCheckBox::toggled, toggle_,
                   [this](bool value) { send_(name_, value); });
}

void ParameterField::makeChoice(QWidget* parent) {
  widget_ = choice_ = new QComboBox(parent);
  QObject::connect(choice_, QOverload<int>::of(&QComboBox::currentIndexChanged), choice_,
                   [this](int) { send_(name_, choice_->currentText().toStdString()); });
}

void ParameterField::setChoices(const std::vector<std::string>& choices) {
  const QSignalBlocker quiet(choice_);
  choice_->clear();
  for (const std::string& choice : choices) choice_->addItem(QString::fromStdString(choice));
  choice_->setCurrentIndex(-1);
}

void ParameterField::show(const dynamic_reconfigure::ConfigDescription* description,
                          const dynamic_reconfigure::Config* values) {
  const QSignalBlocker quiet(widget_);
  TrackerLink::Value value;
  const bool is_there = values && findValue(*values, name_, &value);
  widget_->setEnabled(is_there);
  widget_->setToolTip(
      !values     ? QString("nothing is known of the tracker's parameters yet")
      : !is_there ? QString("this tracker has no parameter %1").arg(QString::fromStdString(name_))
                  : QString::fromStdString(name_));
  if (!is_there) {
    if (number_) number_->clear();
    return;
  }
  is_whole_ = std::holds_alternative<int>(value);
  if (description) describe(*description);
  showValue(value);
}

void ParameterField::describe(const dynamic_reconfigure::ConfigDescription& description) {
  const auto* parameter = findDescription(description, name_);
  if (!parameter) return;
  widget_->setToolTip(QString::fromStdString("<b>" + name_ + "</b>: ") +
                      QString::fromStdString(parameter->description).toHtmlEscaped());
  TrackerLink::Value minimum, maximum;
  if (!number_ || !findValue(description.min, name_, &minimum) ||
      !findValue(description.max, name_, &maximum))
    return;
  number_->setDecimals(is_whole_ ? 0 : kDecimals);
  number_->setRange(toNumber(minimum), toNumber(maximum));
}

void ParameterField::showValue(const TrackerLink::Value& value) {
  if (number_) {
    // What is being typed is left alone.
    if (!number_->hasFocus() || number_->value() != toNumber(value))
      number_->setValue(toNumber(value));
  } else if (toggle_) {
    toggle_->setChecked(toNumber(value) != 0.0);
  } else if (const auto* text = std::get_if<std::string>(&value)) {
    const QString wanted = QString::fromStdString(*text);
    if (choice_->findText(wanted) < 0) choice_->addItem(wanted);
    choice_->setCurrentText(wanted);
  }
}

}  // namespace active_matching_slam
