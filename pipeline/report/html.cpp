#include "pipeline/report/html.h"

#include <utility>

#include "formats/base/check.h"

namespace patina {
namespace {

constexpr std::string_view kReplacement = "\xEF\xBF\xBD";

// Length of the UTF-8 sequence at `at` that stands for a character XML allows; 0 if there is none.
size_t CharacterLength(std::string_view text, size_t at) {
  const auto byte = [&](size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned lead = byte(at);
  if (lead < 0x80) return lead >= 0x20 && lead != 0x7F ? 1 : 0;
  const size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || at + length > text.size()) return 0;
  unsigned code = lead & (0x7Fu >> length);
  for (size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xC0) != 0x80) return 0;
    code = code << 6 | (byte(at + i) & 0x3Fu);
  }
  static constexpr unsigned kLeast[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool surrogate = code >= 0xD800 && code <= 0xDFFF;
  const bool noncharacter = (code & 0xFFFE) == 0xFFFE;
  const bool control = code < 0xA0;  // C1
  // What turns the direction of the text after it: a name could make a sentence of ours say
  // something else.
  const bool turns = (code >= 0x202A && code <= 0x202E) || (code >= 0x2066 && code <= 0x2069);
  if (code < kLeast[length] || code > 0x10FFFF || surrogate || noncharacter || control || turns)
    return 0;
  return length;
}

}  // namespace

std::string EscapeHtml(std::string_view text) {
  std::string escaped;
  escaped.reserve(text.size() + text.size() / 8);
  for (size_t at = 0; at < text.size();) {
    const size_t length = CharacterLength(text, at);
    switch (text[at]) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      case '\n':
      case '\t':
        escaped += text[at];
        break;
      default:
        escaped += length > 0 ? text.substr(at, length) : kReplacement;
    }
    at += length > 0 ? length : 1;
  }
  return escaped;
}

void Html::Tag(const char* element, Attributes attributes, const char* end) {
  text_ += '<';
  text_ += element;
  for (const HtmlAttribute& attribute : attributes) {
    if (attribute.value.empty() && std::string_view(attribute.name) == "class") continue;
    text_ += ' ';
    text_ += attribute.name;
    text_ += "=\"";
    text_ += EscapeHtml(attribute.value);
    text_ += '"';
  }
  text_ += end;
}

Html& Html::Open(const char* element, Attributes attributes) {
  Tag(element, attributes, ">");
  open_.push_back(element);
  return *this;
}

Html& Html::Close() {
  PATINA_CHECK(!open_.empty());
  text_ += "</";
  text_ += open_.back();
  text_ += ">\n";
  open_.pop_back();
  return *this;
}

Html& Html::Text(std::string_view text) {
  text_ += EscapeHtml(text);
  return *this;
}

Html& Html::Add(const char* element, std::string_view text, Attributes attributes) {
  return Open(element, attributes).Text(text).Close();
}

Html& Html::AddEmpty(const char* element, Attributes attributes) {
  Tag(element, attributes, "/>\n");
  return *this;
}

Html& Html::AddStyle(std::string_view css) {
  PATINA_CHECK(css.find_first_of("<&") == std::string_view::npos);
  text_ += "<style>\n";
  text_ += css;
  text_ += "</style>\n";
  return *this;
}

std::string Html::Take() {
  PATINA_CHECK(open_.empty());
  return std::move(text_);
}

}  // namespace patina
