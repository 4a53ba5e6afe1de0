// Reads typed values out of a parsed JSON document that nobody vouches for, and keeps the first
// problem with its JSON pointer.
//
//   JsonProblem problem;
//   JsonView root(&document, &problem);
//   const int width = root.Field("width").Int(1, 65536);
//   if (!problem.text.empty()) return Fail(ErrorCode::kCorruptData, problem.text);
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "formats/base/names.h"
#include "formats/base/strict_json.h"

namespace patina {

// The first problem met: "<JSON pointer>: <what is wrong>"; empty if none.
struct JsonProblem {
  std::string text;
};

// A value of the document, or nothing. Reading nothing returns zero, an empty string or false. The
// document and the problem must outlive the view.
class JsonView {
 public:
  JsonView(const nlohmann::json* value, JsonProblem* problem) : JsonView(value, "", problem) {}

  explicit operator bool() const { return value_ != nullptr; }

  // A member that must be there.
  JsonView Field(const char* key) const {
    JsonView member = Optional(key);
    if (value_ != nullptr && value_->is_object() && !member)
      Report(pointer_, std::string("\"") + key + "\" is missing");
    return member;
  }

  // A member that may be absent.
  JsonView Optional(const char* key) const {
    if (value_ == nullptr) return {nullptr, pointer_, problem_};
    if (!value_->is_object()) return Wrong("an object");
    const auto found = value_->find(key);
    return {found == value_->end() ? nullptr : &*found, pointer_ + "/" + key, problem_};
  }

  std::string String(size_t max_bytes = 4096) const {
    if (value_ == nullptr) return "";
    if (!value_->is_string()) return Wrong("a string"), "";
    const auto& text = value_->get_ref<const std::string&>();
    if (text.size() > max_bytes) {
      Report(pointer_, "a string of " + std::to_string(text.size()) + " bytes, more than " +
                           std::to_string(max_bytes));
      return "";
    }
    return text;
  }

  int Int(int min, int max) const {
    if (value_ == nullptr) return min > 0 ? min : 0;
    if (!value_->is_number_integer()) return Wrong("an integer"), 0;
    const bool in_range =
        value_->is_number_unsigned()
            ? max >= 0 && value_->get<uint64_t>() <= static_cast<uint64_t>(max) &&
                  (min <= 0 || value_->get<uint64_t>() >= static_cast<uint64_t>(min))
            : value_->get<int64_t>() >= min && value_->get<int64_t>() <= max;
    if (!in_range) {
      Report(pointer_, value_->dump() + " is not within " + std::to_string(min) + " to " +
                           std::to_string(max));
      return 0;
    }
    return value_->get<int>();
  }

  uint64_t Unsigned() const {
    if (value_ == nullptr) return 0;
    if (!value_->is_number_unsigned()) return Wrong("a non-negative integer"), 0;
    return value_->get<uint64_t>();
  }

  double Number() const {
    if (value_ == nullptr) return 0;
    if (!value_->is_number()) return Wrong("a number"), 0;
    return value_->get<double>();
  }

  // A number, or null for infinity.
  double NumberOrInfinity() const {
    if (value_ != nullptr && value_->is_null()) return std::numeric_limits<double>::infinity();
    return Number();
  }

  // A number that is finite as a float.
  float Float() const {
    const double value = Number();
    if (std::abs(value) > static_cast<double>(std::numeric_limits<float>::max())) {
      Report(pointer_, "the number is too large for single precision");
      return 0;
    }
    return static_cast<float>(value);
  }

  bool Bool() const {
    if (value_ == nullptr) return false;
    if (!value_->is_boolean()) return Wrong("true or false"), false;
    return value_->get<bool>();
  }

  // Calls visit(JsonView) for each element of an array.
  template <class Visit>
  void ForEach(size_t max_elements, Visit&& visit) const {
    if (value_ == nullptr) return;
    if (!value_->is_array()) {
      Wrong("an array");
      return;
    }
    if (value_->size() > max_elements) {
      Report(pointer_, "an array of " + std::to_string(value_->size()) + " elements, more than " +
                           std::to_string(max_elements));
      return;
    }
    for (size_t i = 0; i < value_->size(); ++i) {
      visit(JsonView(&(*value_)[i], pointer_ + "/" + std::to_string(i), problem_));
    }
  }

  // Calls visit(const std::string& key, JsonView) for each member of an object, in order of keys.
  template <class Visit>
  void ForEachMember(size_t max_members, Visit&& visit) const {
    if (value_ == nullptr) return;
    if (!value_->is_object()) {
      Wrong("an object");
      return;
    }
    if (value_->size() > max_members) {
      Report(pointer_, "an object of " + std::to_string(value_->size()) + " members, more than " +
                           std::to_string(max_members));
      return;
    }
    for (const auto& [key, member] : value_->items()) {
      visit(key, JsonView(&member, pointer_ + "/" + EscapePointer(key), problem_));
    }
  }

 private:
  JsonView(const nlohmann::json* value, std::string pointer, JsonProblem* problem)
      : value_(value), pointer_(std::move(pointer)), problem_(problem) {}

  void Report(const std::string& pointer, const std::string& text) const {
    if (problem_->text.empty())
      problem_->text = (pointer.empty() ? "document root" : pointer) + ": " + text;
  }
  JsonView Wrong(const char* wanted) const {
    Report(pointer_, std::string(value_->type_name()) + " instead of " + wanted);
    return {nullptr, pointer_, problem_};
  }

  const nlohmann::json* value_;
  std::string pointer_;
  JsonProblem* problem_;
};

}  // namespace patina
