// What the next seconds of a training are likely to bring: a line through the quality of the last seconds.
#pragma once

#include <algorithm>
#include <deque>

namespace patina {

class QualityTrend {
 public:
  // seconds: never less than at the call before. Values that are not finite or not above 0 are passed over.
  void Add(double seconds, double psnr_db) {
    if (!(psnr_db > 0 && psnr_db < 1e3)) return;
    points_.push_back({seconds, psnr_db});
    // A quarter of the time so far, and 3 seconds at least: single readings differ by some tenths of a dB.
    const double span = std::max(3.0, 0.25 * seconds);
    while (points_.front().seconds < seconds - span) points_.pop_front();
  }

  // dB that so many more seconds bring if it goes on like that; never negative; 0 before there are readings enough.
  double GainWithin(double seconds) const {
    constexpr size_t kFewest = 6;
    if (points_.size() < kFewest) return 0;
    double mean_s = 0, mean_db = 0;
    for (const Point& p : points_) {
      mean_s += p.seconds;
      mean_db += p.psnr_db;
    }
    const auto count = static_cast<double>(points_.size());
    mean_s /= count;
    mean_db /= count;
    double product = 0, square = 0;
    for (const Point& p : points_) {
      product += (p.seconds - mean_s) * (p.psnr_db - mean_db);
      square += (p.seconds - mean_s) * (p.seconds - mean_s);
    }
    return square > 0 ? std::max(0.0, product / square * seconds) : 0;
  }

 private:
  struct Point {
    double seconds, psnr_db;
  };
  std::deque<Point> points_;
};

}  // namespace patina
