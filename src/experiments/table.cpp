#include "active_matching_slam/experiments/table.h"

#include <cmath>
#include <stdexcept>

#include "active_matching_slam/evaluation/text_file.h"

namespace active_matching_slam {
namespace {

std::string quoted(const std::string& cell) {
  if (cell.find_first_of(",\"\n") == std::string::npos) return cell;
  std::string text = "\"";
  for (const char c : cell) text += c == '"' ? std::string("\"\"") : std::string(1, c);
  return text + "\"";
}

std::string line(const std::vector<std::string>& cells) {
  std::string text;
  for (std::size_t i = 0; i < cells.size(); ++i) text += (i > 0 ? "," : "") + quoted(cells[i]);
  return text + "\n";
}

}  // namespace

Cell::Cell(double value) : text_(std::isfinite(value) ? numberText(value) : "") {}

void Table::add(const std::vector<Cell>& cells) {
  if (cells.size() != columns_.size())
    throw std::invalid_argument("a row of " + std::to_string(cells.size()) + " cells for " +
                                std::to_string(columns_.size()) + " columns");
  rows_.emplace_back();
  for (const Cell& cell : cells) rows_.back().push_back(cell.text());
}

std::string Table::csv() const {
  std::string text = line(columns_);
  for (const auto& row : rows_) text += line(row);
  return text;
}

}  // namespace active_matching_slam
