#include "pipeline/jobs/preview.h"

namespace patina {

void Preview::Capture(std::span<const metrics::QualityMap> maps, int width, int height,
                      std::span<const metrics::PlanePair> planes, ThreadPool& pool) {
  rows_.clear();
  for (const metrics::QualityMap& map : maps) {
    const MapView view(map, width, height, planes);
    planes = planes.subspan(static_cast<size_t>(map.channels));
    rows_.push_back({view.Reduce(kTile, pool), view.Detail(kTile)});
  }
}

RgbImage Preview::Compose(const std::string& title, std::span<const std::string> labels) const {
  static const std::string kHeads[] = {"source", "decoded", "difference x8", "source 1:1",
                                       "decoded 1:1"};
  std::vector<SheetRow> rows;
  for (size_t i = 0; i < rows_.size(); ++i) {
    const Row& row = rows_[i];
    rows.push_back({i < labels.size() ? labels[i] : "",
                    {&row.whole.source, &row.whole.decoded, &row.whole.difference,
                     &row.detail.source, &row.detail.decoded}});
  }
  return ComposeSheet(title, kHeads, rows);
}

}  // namespace patina
