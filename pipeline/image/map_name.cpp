#include "pipeline/image/map_name.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <iterator>
#include <string_view>

namespace patina {
namespace {

struct Word {
  std::string text;  // lower case
  size_t begin = 0;  // in the name
  size_t end = 0;
};

bool IsUpper(char c) { return c >= 'A' && c <= 'Z'; }
bool IsLower(char c) { return c >= 'a' && c <= 'z'; }
bool IsDigit(char c) { return c >= '0' && c <= '9'; }
bool IsSeparator(char c) {
  return std::string_view("_-. ()[]{}+,&@#").find(c) != std::string_view::npos;
}

std::vector<Word> SplitWords(const std::string& name) {
  std::vector<Word> words;
  Word word;
  const auto flush = [&](size_t end) {
    if (!word.text.empty()) {
      word.end = end;
      words.push_back(word);
    }
    word.text.clear();
  };
  for (size_t i = 0; i < name.size(); ++i) {
    const char c = name[i];
    if (IsSeparator(c)) {
      flush(i);
      continue;
    }
    const char before = i > 0 ? name[i - 1] : '_';
    const char after = i + 1 < name.size() ? name[i + 1] : '_';
    const bool starts_word =
        IsUpper(c) && (IsLower(before) || ((IsUpper(before) || IsDigit(before)) && IsLower(after)));
    // "sRGB" is one word.
    if (starts_word && word.text != "s") flush(i);
    if (word.text.empty()) word.begin = i;
    word.text += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  flush(name.size());
  return words;
}

bool AllDigits(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), IsDigit);
}

int SmallNumber(std::string_view digits) {
  int value = 0;
  for (const char c : digits.substr(0, 7)) value = value * 10 + (c - '0');
  return value;
}

// Texels a side of "2k", "2048", "2048x1024", "2048px"; 0 for any other word.
int Resolution(std::string_view word) {
  if (word.size() > 2 && word.substr(word.size() - 2) == "px") word.remove_suffix(2);
  if (word.size() >= 2 && word.size() <= 3 && word.back() == 'k' &&
      AllDigits(word.substr(0, word.size() - 1))) {
    return SmallNumber(word.substr(0, word.size() - 1)) * 1024;
  }
  const size_t cross = word.find('x');
  if (cross != std::string_view::npos) {
    if (!AllDigits(word.substr(0, cross)) || !AllDigits(word.substr(cross + 1))) return 0;
    return std::max(SmallNumber(word.substr(0, cross)), SmallNumber(word.substr(cross + 1)));
  }
  if (!AllDigits(word) || word.size() > 5) return 0;
  const int value = SmallNumber(word);
  return value >= 64 && value <= 65536 && (value & (value - 1)) == 0 ? value : 0;
}

bool HasNumberAfter(std::string_view word, std::string_view prefix) {
  return word.size() > prefix.size() && word.substr(0, prefix.size()) == prefix &&
         AllDigits(word.substr(prefix.size()));
}

bool IsDecoration(std::string_view word) {
  static constexpr std::array<std::string_view, 25> kWords = {
      "8bit",  "16bit", "32bit", "8b",      "16b", "32b", "16f",  "32f", "half",
      "float", "jpg",   "jpeg",  "png",     "exr", "tif", "tiff", "tga", "hdr",
      "map",   "maps",  "tex",   "texture", "lq",  "hq",  "final"};
  return std::find(kWords.begin(), kWords.end(), word) != kWords.end();
}

bool IsTile(std::string_view word) { return word.size() == 4 && AllDigits(word) && word[0] == '1'; }

// A word that may follow the token or stand in the stem without belonging to either. Notes what it
// says.
bool TakeQualifier(const std::string& word, MapName* name) {
  if (const int resolution = Resolution(word); resolution > 0) {
    name->resolution = std::max(name->resolution, resolution);
  } else if (HasNumberAfter(word, "lod")) {
    name->level_of_detail = SmallNumber(std::string_view(word).substr(3));
  } else if (HasNumberAfter(word, "var")) {
    name->variant = SmallNumber(std::string_view(word).substr(3));
  } else if (word == "srgb") {
    name->color_space = "srgb";
  } else if (word == "linear" || word == "lin") {
    name->color_space = "linear";
  } else if (word == "raw" || word == "noncolor") {
    name->color_space = "raw";
  } else {
    return false;
  }
  return true;
}

// The longest run of words that ends before `end` and is a token. Returns how many words it takes,
// 0 for none.
size_t MatchAt(const std::vector<Word>& words, size_t end, const MapToken** token) {
  constexpr size_t kLongest = 8;
  for (size_t count = std::min(end, kLongest); count > 0; --count) {
    std::string squashed;
    for (size_t i = end - count; i < end; ++i) squashed += words[i].text;
    *token = FindMapToken(squashed);
    // "NRM16", "DISP16": the bit depth glued to the word.
    if (*token == nullptr && squashed.size() > 4 && squashed.ends_with("16")) {
      *token = FindMapToken(squashed.substr(0, squashed.size() - 2));
    }
    // "normalmap": a word for the map glued to "map".
    if (*token == nullptr && squashed.size() > 5 && squashed.ends_with("map")) {
      *token = FindMapToken(squashed.substr(0, squashed.size() - 3));
    }
    if (*token != nullptr) return count;
  }
  return 0;
}

// Some shops name the workflow after the resolution: "Name_COL_4K_METALNESS" is a colour map.
bool IsWorkflowWord(const std::vector<Word>& words, size_t end) {
  const std::string& word = words[end - 1].text;
  const MapToken* token = nullptr;
  return end >= 3 && (word == "metalness" || word == "specular") &&
         Resolution(words[end - 2].text) > 0 && MatchAt(words, end - 2, &token) > 0;
}

}  // namespace

MapName ParseMapName(const std::string& text) {
  MapName name;
  const std::vector<Word> words = SplitWords(text);
  size_t end = words.size();
  size_t length = 0;
  bool numbered = false;
  while (end > 0) {
    if (IsWorkflowWord(words, end)) {
      --end;
      continue;
    }
    length = MatchAt(words, end, &name.token);
    if (length > 0) break;
    const std::string& word = words[end - 1].text;
    if (TakeQualifier(word, &name) || IsDecoration(word)) {
      --end;
    } else if (IsTile(word) && name.tile.empty()) {
      name.tile = word;
      --end;
    } else if (AllDigits(word) && word.size() <= 3 && !numbered) {
      numbered = true;
      name.variant = SmallNumber(word);
      --end;
    } else {
      break;
    }
  }
  MapName qualifiers = name;
  for (const Word& word : words) {
    if (!TakeQualifier(word.text, &qualifiers) && !IsDecoration(word.text))
      name.all_words.push_back(word.text);
  }
  if (name.token == nullptr) {
    MapName plain;
    plain.all_words = std::move(name.all_words);
    return plain;
  }
  name.convention = name.token->convention;
  name.bare_number = numbered;
  size_t stem_begin = std::string::npos, stem_end = 0;
  bool after_resolution = false;
  for (size_t i = 0; i < end - length; ++i) {
    const std::string& word = words[i].text;
    const bool resolution = Resolution(word) > 0;
    // "1K-JPG" is one remark; elsewhere in a stem such words are part of the name.
    const bool skip = TakeQualifier(word, &name) || (after_resolution && IsDecoration(word));
    after_resolution = resolution;
    if (skip) continue;
    if (name.tile.empty() && IsTile(word) && i > 0) {
      name.tile = word;
      continue;
    }
    name.stem_words.push_back(word);
    stem_begin = std::min(stem_begin, words[i].begin);
    stem_end = words[i].end;
  }
  if (stem_end > 0) name.stem = text.substr(stem_begin, stem_end - stem_begin);
  return name;
}

std::string LowerExtension(const std::string& file) {
  std::string extension = std::filesystem::path(file).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

bool HasImageExtension(const std::string& file_name) {
  static constexpr std::string_view kKnown[] = {".png",  ".jpg", ".jpeg", ".tga", ".tif",
                                                ".tiff", ".exr", ".hdr",  ".dds"};
  return std::find(std::begin(kKnown), std::end(kKnown), LowerExtension(file_name)) !=
         std::end(kKnown);
}

}  // namespace patina
