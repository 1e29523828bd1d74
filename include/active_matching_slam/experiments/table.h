#pragma once

#include <string>
#include <vector>

namespace active_matching_slam {

/// One value of a table, as text that reads back bit for bit; what is not a finite number is empty.
class Cell {
 public:
  Cell(std::string text) : text_(std::move(text)) {}
  Cell(const char* text) : text_(text) {}
  Cell(double value);
  Cell(int value) : text_(std::to_string(value)) {}
  Cell(long value) : text_(std::to_string(value)) {}
  Cell(bool value) : text_(value ? "1" : "0") {}
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

/// Rows of named columns. Columns whose name ends in "_ms" hold durations: they depend on the
/// machine, all others are the same bit for bit in every run.
class Table {
 public:
  Table() = default;
  explicit Table(std::vector<std::string> columns) : columns_(std::move(columns)) {}

  /// Throws std::invalid_argument unless there is one cell a column.
  void add(const std::vector<Cell>& cells);
  int rows() const { return static_cast<int>(rows_.size()); }

  /// Comma separated, the names in the first line; text with commas in it is quoted.
  std::string csv() const;

 private:
  std::vector<std::string> columns_;
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace active_matching_slam
