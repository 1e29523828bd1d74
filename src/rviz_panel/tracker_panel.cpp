#include "active_matching_slam/rviz_panel/tracker_panel.h"

#include <QAbstractItemView>
#include <QCheckBox>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QFormLayout>
#include <QGridLayout>
#include <QGroupBox>
#include <QHBoxLayout>
#include <QLabel>
#include <QLineEdit>
#include <QProgressBar>
#include <QPushButton>
#include <QScrollArea>
#include <QSignalBlocker>
#include <QStyle>
#include <QTimer>
#include <algorithm>
#include <cmath>

#include "active_matching_slam/matching/matcher.h"

namespace active_matching_slam {
namespace {

using ams_msgs::TrackingState;

/// Between two looks at the report. Cost: a few labels redrawn each time.
constexpr int kRefreshPeriod_ms = 100;

const char* const kDrawPrefix = "draw/";

QString badgeStyle(const char* color) {
  return QString(
             "QLabel { background: %1; color: white; font-weight: bold; border-radius: 3px; "
             "padding: 3px 8px; }")
      .arg(color);
}

const char* stateColor(int state) {
  switch (state) {
    case TrackingState::TRACKING:
      return "#2e7d32";
    case TrackingState::INITIALISING:
      return "#b26a00";
    case TrackingState::LOST:
      return "#c62828";
    default:
      return "#616161";
  }
}

QString scaleText(const TrackingState& state) {
  if (state.scale_source == TrackingState::SCALE_FREE) return "free: lengths are in map units";
  return "metres, from " + QString::fromStdString(state.scale_source_name).replace('_', ' ');
}

QFormLayout* addForm(QBoxLayout* column) {
  auto* form = new QFormLayout;
  form->setContentsMargins(0, 0, 0, 0);
  form->setVerticalSpacing(3);
  column->addLayout(form);
  return form;
}

/// As a launch file remaps it; what is no name stays as it is.
QString resolvedName(const QString& name) {
  std::string error;
  if (name.isEmpty() || !ros::names::validate(name.toStdString(), error)) return name;
  return QString::fromStdString(ros::names::resolve(name.toStdString()));
}

void setText(QLabel* label, const QString& text) {
  if (label->text() != text) label->setText(text);
}

}  // namespace

TrackerPanel::TrackerPanel(QWidget* parent) : rviz::Panel(parent) {
  auto* content = new QWidget;
  auto* column = new QVBoxLayout(content);
  column->setContentsMargins(6, 6, 6, 6);
  column->setSpacing(6);
  addStatus(column);
  addMatching(column);
  addMap(column);
  addSubmaps(column);
  addDrawing(column);
  column->addStretch();

  auto* scroll = new QScrollArea;
  scroll->setWidget(content);
  scroll->setWidgetResizable(true);
  scroll->setFrameShape(QFrame::NoFrame);
  scroll->setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
  scroll->setMinimumWidth(content->minimumSizeHint().width() +
                          style()->pixelMetric(QStyle::PM_ScrollBarExtent));
  auto* outer = new QVBoxLayout(this);
  outer->setContentsMargins(0, 0, 0, 0);
  outer->addWidget(scroll);
  answer_ = new QLabel(this);
  answer_->setObjectName("answer");
  answer_->setWordWrap(true);
  answer_->setMargin(6);
  answer_->setTextInteractionFlags(Qt::TextSelectableByMouse);
  outer->addWidget(answer_);

  chooseTracker();
  timer_ = new QTimer(this);
  connect(timer_, &QTimer::timeout, this, [this] { refresh(); });
  timer_->start(kRefreshPeriod_ms);
  refresh();
}

TrackerPanel::~TrackerPanel() = default;

QSize TrackerPanel::sizeHint() const { return QSize(340, 700); }

QLabel* TrackerPanel::addLine(const QString& name, QBoxLayout* column) {
  auto* label = new QLabel;
  label->setObjectName(name);
  label->setWordWrap(true);
  label->setTextInteractionFlags(Qt::TextSelectableByMouse);
  column->addWidget(label);
  return label;
}

QPushButton* TrackerPanel::addButton(const QString& name, const QString& text, const QString& help,
                                     QBoxLayout* row) {
  auto* button = new QPushButton(text);
  button->setObjectName(name);
  button->setToolTip(help);
  row->addWidget(button);
  buttons_.push_back(button);
  return button;
}

ParameterField* TrackerPanel::addField(const std::string& name, ParameterField::Kind kind,
                                       const QString& label, QWidget* parent) {
  fields_.push_back(std::make_unique<ParameterField>(
      name, kind, label, parent, [this](const std::string& parameter, const auto& value) {
        link_.setParameter(parameter, value);
      }));
  return fields_.back().get();
}

void TrackerPanel::addStatus(QBoxLayout* column) {
  auto* row = new QHBoxLayout;
  name_ = new QComboBox;
  name_->setObjectName("tracker");
  name_->setEditable(true);
  name_->setInsertPolicy(QComboBox::NoInsert);
  name_->setToolTip("the tracker's name; saved with rviz's configuration");
  name_->setEditText("/tracker");
  name_->setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Fixed);
  connect(name_->lineEdit(), &QLineEdit::editingFinished, this, [this] { chooseTracker(); });
  connect(name_, QOverload<int>::of(&QComboBox::activated), this, [this](int) { chooseTracker(); });
  row->addWidget(new QLabel("Tracker"));
  row->addWidget(name_);
  column->addLayout(row);

  row = new QHBoxLayout;
  badge_ = new QLabel;
  badge_->setObjectName("state");
  badge_->setAlignment(Qt::AlignCenter);
  badge_->setStyleSheet(badgeStyle(stateColor(-1)));
  badge_->setText("INITIALISING");  // the longest
  badge_->setMinimumWidth(badge_->sizeHint().width());
  row->addWidget(badge_);
  quality_ = new QProgressBar;
  quality_->setObjectName("quality");
  quality_->setRange(0, 100);
  quality_->setToolTip("whether poses can be trusted");
  row->addWidget(quality_, 1);
  column->addLayout(row);
  reason_ = addLine("reason", column);

  auto* lines = addForm(column);
  const auto addRow = [&](const QString& title, const QString& name) {
    auto* label = new QLabel;
    label->setObjectName(name);
    label->setWordWrap(true);
    lines->addRow(title, label);
    return label;
  };
  scale_ = addRow("Scale", "scale");
  map_ = addRow("Map", "map");
  matches_ = addRow("Image", "matches");
}

void TrackerPanel::addMatching(QBoxLayout* column) {
  auto* box = new QGroupBox("Matching");
  auto* rows = new QVBoxLayout(box);
  auto* form = addForm(rows);
  ParameterField* matcher = addField("matcher", ParameterField::Kind::kChoice, {}, box);
  matcher->setChoices(matcherNames());
  form->addRow("Matcher", matcher->widget());
  for (const auto& [label, name] :
       {std::pair{"Features a frame", "map/features_per_frame"},
        std::pair{"Time for matching [ms]", "matching/max_milliseconds"},
        std::pair{"Stop below [bit]", "matching/stop_bits"}})
    form->addRow(label, addField(name, ParameterField::Kind::kNumber, {}, box)->widget());
  column->addWidget(box);
}

void TrackerPanel::addMap(QBoxLayout* column) {
  auto* box = new QGroupBox("Map");
  auto* rows = new QVBoxLayout(box);
  auto* row = new QHBoxLayout;
  file_ = new QLineEdit("map.map");
  file_->setObjectName("file");
  file_->setToolTip("a file name without a path: maps live in the tracker's data_directory");
  row->addWidget(file_, 1);
  connect(addButton("save", "Save", "save the map under this name", row), &QPushButton::clicked,
          this, [this] { link_.saveMap(file_->text().toStdString()); });
  connect(
      addButton("load", "Load", "load the map of this name, and look for the camera in it", row),
      &QPushButton::clicked, this, [this] { link_.loadMap(file_->text().toStdString()); });
  connect(file_, &QLineEdit::editingFinished, this, [this] { Q_EMIT configChanged(); });
  rows->addLayout(row);

  row = new QHBoxLayout;
  row->addWidget(new QLabel("All lengths times"));
  factor_ = new QDoubleSpinBox;
  factor_->setObjectName("factor");
  factor_->setLocale(QLocale::c());
  factor_->setDecimals(4);
  factor_->setRange(1e-4, 1e4);
  factor_->setValue(1.0);
  factor_->setStepType(QAbstractSpinBox::AdaptiveDecimalStepType);
  factor_->setToolTip("a true length by what it is in the map");
  row->addWidget(factor_, 1);
  connect(addButton("set_scale", "Set scale", "multiply all lengths", row), &QPushButton::clicked,
          this, [this] { link_.setScale(factor_->value()); });
  rows->addLayout(row);
  connect(addButton("reset", "Reset: begin a new map",
                    "empties the map; the next image starts anew", rows),
          &QPushButton::clicked, this, [this] { link_.reset(); });
  column->addWidget(box);
}

void TrackerPanel::addSubmaps(QBoxLayout* column) {
  submaps_ = new QGroupBox("Submaps");
  submaps_->setObjectName("submaps");
  submaps_->setCheckable(true);
  submaps_->setToolTip("off: this panel doesn't ask for them, which costs the tracker time");
  link_.setWantsSubmaps(true);
  connect(submaps_, &QGroupBox::toggled, this, [this](bool wants) {
    link_.setWantsSubmaps(wants);
    Q_EMIT configChanged();
  });
  auto* rows = new QVBoxLayout(submaps_);
  submaps_text_ = addLine("submaps_text", rows);
  auto* form = addForm(rows);
  for (const auto& [label, name] :
       {std::pair{"Level shown", "submap_level"}, std::pair{"How many", "submaps/count"},
        std::pair{"Information kept", "submaps/preserve"},
        std::pair{"Features in each", "submaps/max_features"}})
    form->addRow(label, addField(name, ParameterField::Kind::kNumber, {}, submaps_)->widget());
  column->addWidget(submaps_);
}

void TrackerPanel::addDrawing(QBoxLayout* column) {
  drawing_ = new QGroupBox("Drawn in the image");
  drawing_->setObjectName("drawing");
  auto* rows = new QVBoxLayout(drawing_);
  toggle_grid_ = new QGridLayout;
  toggle_grid_->setVerticalSpacing(2);
  rows->addLayout(toggle_grid_);
  auto* form = addForm(rows);
  for (const auto& [label, name] : {std::pair{"Links of a feature", "draw/links_per_feature"},
                                    std::pair{"Links from [bit]", "draw/minimum_link_bits"}})
    form->addRow(label, addField(name, ParameterField::Kind::kNumber, {}, drawing_)->widget());
  column->addWidget(drawing_);
}

void TrackerPanel::chooseTracker() {
  link_.setTracker(name_->currentText().trimmed().toStdString());
  Q_EMIT configChanged();
}

void TrackerPanel::load(const rviz::Config& config) {
  rviz::Panel::load(config);
  QString text;
  bool is_on = true;
  if (config.mapGetString("Tracker", &text)) name_->setEditText(resolvedName(text));
  if (config.mapGetString("Map File", &text)) file_->setText(text);
  if (config.mapGetBool("Submaps", &is_on)) submaps_->setChecked(is_on);
  chooseTracker();
}

void TrackerPanel::save(rviz::Config config) const {
  rviz::Panel::save(config);
  config.mapSetValue("Tracker", name_->currentText());
  config.mapSetValue("Map File", file_->text());
  config.mapSetValue("Submaps", submaps_->isChecked());
}

void TrackerPanel::refresh() {
  const TrackerReport report = link_.report();
  offerTrackers(report);
  showStatus(report);
  showStatistics(report);
  showSubmaps(report);
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
  QString state, reason;
  const char* color = stateColor(-1);
  const bool has_state = report.is_there && report.state;
  if (report.tracker.empty()) {
    state = "NO NAME";
    reason = QString("'%1' is no name of a tracker").arg(name_->currentText());
  } else if (!report.has_master) {
    state = "NO MASTER";
    reason = "the ROS master does not answer";
  } else if (!report.is_asked_for) {
    state = "...";
  } else if (!report.is_there) {
    state = "NO TRACKER";
    reason = "no tracker at " + QString::fromStdString(report.tracker);
    QStringList others;
    for (const std::string& other : report.others)
      if (other != report.tracker) others << QString::fromStdString(other);
    if (!others.empty()) reason += "; there is one at " + others.join(", ");
  } else if (!report.state) {
    state = "WAITING";
    reason = "no image was tracked yet";
  } else {
    state = QString::fromStdString(report.state->state_name).toUpper();
    color = stateColor(report.state->state);
    reason = QString::fromStdString(report.state->reason.empty() ? report.state->quality_reason
                                                                 : report.state->reason);
    // A second is longer than the interval of any camera that can be tracked.
    if (report.silence_s > 1.0)
      reason += QString("%1last image %2 s ago")
                    .arg(reason.isEmpty() ? "" : "; ")
                    .arg(std::floor(report.silence_s), 0, 'f', 0);
  }
  setText(badge_, state);
  const QString style = badgeStyle(color);
  if (badge_->styleSheet() != style) badge_->setStyleSheet(style);
  setText(reason_, reason);
  reason_->setVisible(!reason.isEmpty());

  const bool has_quality = has_state && report.state->state == TrackingState::TRACKING &&
                           std::isfinite(report.state->quality);
  quality_->setEnabled(has_quality);
  quality_->setValue(has_quality ? static_cast<int>(std::lround(100 * report.state->quality)) : 0);
  quality_->setFormat(has_quality ? QString("quality %1").arg(report.state->quality, 0, 'f', 2)
                                  : QString("quality -"));
  for (QPushButton* button : buttons_) button->setEnabled(report.is_there);
}

void TrackerPanel::showStatistics(const TrackerReport& report) {
  const QString none = "-";
  if (!report.is_there || !report.state) {
    for (QLabel* label : {scale_, map_, matches_}) setText(label, none);
    return;
  }
  setText(scale_, scaleText(*report.state));
  const auto& statistics = report.statistics;
  setText(map_, QString("%1%2lost %3 times, %4 resets")
                    .arg(statistics ? QString("%1 features, ").arg(statistics->features) : "")
                    .arg(report.state->map > 1 ? QString("no. %1, ").arg(report.state->map) : "")
                    .arg(report.state->times_lost)
                    .arg(report.state->resets));
  setText(matches_, statistics ? QString("%1 of %2 matched by %3, %4 ms")
                                     .arg(statistics->matched)
                                     .arg(statistics->candidates)
                                     .arg(QString::fromStdString(statistics->matcher))
                                     .arg(statistics->total_ms, 0, 'f', 1)
                               : none);
}

void TrackerPanel::showSubmaps(const TrackerReport& report) {
  if (!report.is_there || !report.submaps || report.submaps->levels.empty()) {
    setText(submaps_text_, submaps_->isChecked() ? "none yet" : "not asked for");
    return;
  }
  const auto& levels = report.submaps->levels;
  TrackerLink::Value value;
  int level = static_cast<int>(levels.size()) - 1;
  if (report.values && findValue(*report.values, "submap_level", &value))
    if (const auto* chosen = std::get_if<int>(&value)) level = std::min(level, *chosen);
  const auto& shown = levels[static_cast<std::size_t>(std::max(level, 0))];
  setText(submaps_text_,
          QString("%1 submaps of %2 features at level %3 of 0 to %4, which keep %5 % "
                  "of the information")
              .arg(shown.submaps)
              .arg(report.submaps->ids.size())
              .arg(level)
              .arg(levels.size() - 1)
              .arg(100.0 * shown.preserved_chow_liu, 0, 'f', 0));
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
