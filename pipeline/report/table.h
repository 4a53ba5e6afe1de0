// A table with a caption, heads that say what they are of, and cells that can be marked.
#pragma once

#include <string>
#include <vector>

#include "pipeline/report/html.h"

namespace patina {

struct TableCell {
  std::string text;
  const char* mark = "";  // a class of the style sheet: "worst", "good", "bad"; "" for none
  // The same in words, for who sees no colours; follows the text.
  const char* mark_text = "";
  double bar = -1;  // 0 to 1: a bar of this length beside the text; negative: none
};

struct TableRow {
  std::string head;
  std::vector<TableCell> cells;
  bool strong = false;  // sums, totals
};

struct Table {
  std::string caption;
  std::vector<std::string> heads;  // of all columns, that of the row heads included
  std::vector<TableRow> rows;
  bool numbers = true;  // cells are numbers, and stand at the right
};

// Wide tables scroll by themselves, so that the page does not.
void AddTable(const Table& table, Html* html);

}  // namespace patina
