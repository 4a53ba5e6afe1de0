#include "pipeline/report/table.h"

#include <algorithm>

#include "pipeline/report/quantity.h"

namespace patina {
namespace {

void AddBar(double share, Html* html) {
  html->Open("svg", {{"class", "bar"}, {"aria-hidden", "true"}, {"focusable", "false"}});
  const std::string width = FixedText(100 * std::clamp(share, 0.0, 1.0), 2) + "%";
  html->AddEmpty("rect", {{"width", width}, {"height", "100%"}, {"rx", "2"}});
  html->Close();
}

void AddCell(const TableCell& cell, Html* html) {
  html->Open("td", {{"class", cell.mark}});
  html->Text(cell.text);
  if (*cell.mark_text != '\0') {
    html->Text(" ");
    html->Add("small", cell.mark_text);
  }
  if (cell.bar >= 0) AddBar(cell.bar, html);
  html->Close();
}

}  // namespace

void AddTable(const Table& table, Html* html) {
  // Focusable, so that the keyboard can scroll it, too.
  html->Open(
      "div",
      {{"class", "scroll"}, {"role", "region"}, {"tabindex", "0"}, {"aria-label", table.caption}});
  html->Open("table", {{"class", table.numbers ? "numbers" : "words"}});
  html->Add("caption", table.caption);
  html->Open("thead").Open("tr");
  for (const std::string& head : table.heads) html->Add("th", head, {{"scope", "col"}});
  html->Close().Close();
  html->Open("tbody");
  for (const TableRow& row : table.rows) {
    html->Open("tr", {{"class", row.strong ? "strong" : ""}});
    html->Add("th", row.head, {{"scope", "row"}});
    for (const TableCell& cell : row.cells) AddCell(cell, html);
    html->Close();
  }
  html->Close().Close().Close();
}

}  // namespace patina
