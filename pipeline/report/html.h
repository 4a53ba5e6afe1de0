// Writes markup that is HTML5 and well-formed XML at once: elements are closed in order, text from
// outside is escaped, and no bytes can make it anything else.
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace patina {

// The text for the content of an element or a quoted attribute: & < > " ' as references; control
// characters, which XML has no way to write, marks that turn the direction of text, and bytes that
// are not UTF-8 as U+FFFD.
std::string EscapeHtml(std::string_view text);

struct HtmlAttribute {
  const char* name;
  std::string value;  // not escaped yet
};

class Html {
 public:
  using Attributes = std::initializer_list<HtmlAttribute>;

  // Names of elements and attributes are ours and written as they are; all else is escaped. An
  // empty class is left out.
  Html& Open(const char* element, Attributes attributes = {});
  Html& Close();  // the innermost open element
  Html& Text(std::string_view text);
  // An element with text in it.
  Html& Add(const char* element, std::string_view text, Attributes attributes = {});
  // One that has no content: <img/>, <path/>.
  Html& AddEmpty(const char* element, Attributes attributes = {});
  // A style sheet of ours. It may not hold '<' or '&', which HTML and XML read differently there.
  Html& AddStyle(std::string_view css);

  // Everything so far; every element must be closed.
  std::string Take();

 private:
  void Tag(const char* element, Attributes attributes, const char* end);

  std::string text_;
  std::vector<const char*> open_;
};

}  // namespace patina
