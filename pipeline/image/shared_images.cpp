#include "pipeline/image/shared_images.h"

#include <cstring>

#include "pipeline/image/image_io.h"

namespace patina {
namespace {

Image Copy(const Image& image) {
  Image copy;
  copy.path = image.path;
  copy.info = image.info;
  copy.Allocate();
  std::memcpy(copy.bytes.data(), image.bytes.data(), image.row_bytes() * image.info.height);
  return copy;
}

}  // namespace

Result<Image> SharedImages::Read(const std::string& key, const std::string& path) {
  {
    const std::lock_guard lock(mutex_);
    const auto found = images_.find(key);
    if (found != images_.end()) {
      Image copy = Copy(found->second);
      copy.path = path;
      return copy;
    }
    ++files_read_;
  }
  PATINA_ASSIGN(Image image, ReadImage(path));
  const uint64_t size = image.row_bytes() * image.info.height;
  const std::lock_guard lock(mutex_);
  if (size > most_bytes_ || images_.count(key) != 0) return image;
  while (bytes_ + size > most_bytes_) {
    const auto oldest = images_.find(by_age_.front());
    bytes_ -= oldest->second.row_bytes() * oldest->second.info.height;
    images_.erase(oldest);
    by_age_.pop_front();
  }
  images_.emplace(key, Copy(image));
  by_age_.push_back(key);
  bytes_ += size;
  return image;
}

size_t SharedImages::files_read() const {
  const std::lock_guard lock(mutex_);
  return files_read_;
}

}  // namespace patina
