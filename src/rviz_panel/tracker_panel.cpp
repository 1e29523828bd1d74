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
#include "active_matching_slam/rviz_panel/report_text.h"

namespace active_matching_slam {
namespace {

/// Between two looks at the report. Cost: a few labels redrawn each time.
constexpr int kRefreshPeriod_ms = 100;

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
  setBadgeColor(unknownStateColor());
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
  laid_aside_ = addRow("Laid aside", "laid_aside");
  laid_aside_title_ = qobject_cast<QLabel*>(lines->labelForField(laid_aside_));
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
  submaps_ = new QGroupBox("Hierarchy of submaps");
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

}  // namespace active_matching_slam
