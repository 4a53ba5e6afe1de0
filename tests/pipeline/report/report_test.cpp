#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "pipeline/report/html.h"
#include "pipeline/report/line_plot.h"
#include "pipeline/report/page.h"
#include "pipeline/report/picture.h"
#include "pipeline/report/quantity.h"
#include "pipeline/report/table.h"

namespace patina {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
const std::string kReplaced = "\xEF\xBF\xBD";

size_t Count(const std::string& text, const std::string& part) {
  size_t count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

// Whether every element that is opened is closed in order, and no '<' or '&' stands alone.
testing::AssertionResult WellFormed(const std::string& text) {
  std::vector<std::string> open;
  for (size_t at = 0; (at = text.find_first_of("<&", at)) != std::string::npos; ++at) {
    const size_t end = text.find(text[at] == '<' ? '>' : ';', at);
    if (end == std::string::npos) return testing::AssertionFailure() << "open at " << at;
    const std::string tag = text.substr(at + 1, end - at - 1);
    if (text[at] == '&') {
      if (tag.size() > 4) return testing::AssertionFailure() << "a lone & at " << at;
      continue;
    }
    if (tag.find('<') != std::string::npos)
      return testing::AssertionFailure() << "a lone < at " << at;
    if (tag[0] == '!' || tag.back() == '/') continue;
    const std::string name = tag.substr(tag[0] == '/' ? 1 : 0, tag.find_first_of(" \n"));
    if (tag[0] != '/') {
      open.push_back(name);
    } else if (open.empty() || open.back() != name) {
      return testing::AssertionFailure() << "</" << name << "> at " << at;
    } else {
      open.pop_back();
    }
  }
  if (!open.empty()) return testing::AssertionFailure() << open.back() << " is never closed";
  return testing::AssertionSuccess();
}

TEST(EscapeHtml, LeavesNoWayOutOfTextAndAttributes) {
  EXPECT_EQ(EscapeHtml("<img src=x onerror='a(\"b\")'>&amp;"),
            "&lt;img src=x onerror=&#39;a(&quot;b&quot;)&#39;&gt;&amp;amp;");
  EXPECT_EQ(EscapeHtml("a\tb\nc \xC3\xA9 \xE2\x82\xAC \xF0\x9F\x8E\xA8"),
            "a\tb\nc \xC3\xA9 \xE2\x82\xAC \xF0\x9F\x8E\xA8");
}

TEST(EscapeHtml, ReplacesWhatTurnsText) {
  for (const char* mark : {"\xE2\x80\xAA", "\xE2\x80\xAE", "\xE2\x81\xA6", "\xE2\x81\xA9"})
    EXPECT_THAT(EscapeHtml(std::string(mark) + "gnp.exe"), testing::EndsWith(kReplaced + "gnp.exe"));
  EXPECT_EQ(EscapeHtml("\xD7\xA9"), "\xD7\xA9");  // letters may run from right to left
}

TEST(EscapeHtml, ReplacesWhatXmlCannotHold) {
  for (const char* bad : {"\x01", "\x1B", "\r", "\x7F", "\x80", "\xC3", "\xC0", "\xFF"})
    EXPECT_EQ(EscapeHtml(std::string("a") + bad), "a" + kReplaced) << std::hex << int(*bad);
  EXPECT_EQ(EscapeHtml(std::string("\0", 1)), kReplaced);
  EXPECT_EQ(EscapeHtml("\xC0\x80"), kReplaced + kReplaced);                  // overlong
  EXPECT_EQ(EscapeHtml("\xED\xA0\x80"), kReplaced + kReplaced + kReplaced);  // a surrogate
  EXPECT_THAT(EscapeHtml("\xEF\xBF\xBE"), Not(HasSubstr("\xEF\xBF\xBE")));   // U+FFFE
  EXPECT_THAT(EscapeHtml("\xC2\x85"), HasSubstr(kReplaced));                 // C1
  EXPECT_EQ(EscapeHtml("\xE2<b>"), kReplaced + "&lt;b&gt;");  // a cut sequence hides nothing
}

TEST(Html, ClosesInOrderAndEscapes) {
  Html html;
  html.Open("p", {{"title", "\"><script>"}, {"class", ""}}).Text("<b>").Add("i", "&").Close();
  html.AddEmpty("img", {{"alt", ""}});
  const std::string text = html.Take();
  EXPECT_EQ(text,
            "<p title=\"&quot;&gt;&lt;script&gt;\">&lt;b&gt;<i>&amp;</i>\n</p>\n"
            "<img alt=\"\"/>\n");
  EXPECT_TRUE(WellFormed(text));
}

TEST(Page, IsWholeAndFetchesNothing) {
  Html html = BeginPage("</title><script>");
  OpenSection("a", "Heading", &html);
  html.Close();
  const std::string page = FinishPage(std::move(html));
  EXPECT_TRUE(WellFormed(page));
  EXPECT_THAT(page, HasSubstr("<title>&lt;/title&gt;&lt;script&gt;</title>"));
  EXPECT_THAT(page, HasSubstr("default-src &#39;none&#39;"));
  for (const char* part : {"http:", "https:", "<script", "@import", "url(", "//cdn"})
    EXPECT_THAT(page, Not(HasSubstr(part)));
}

TEST(Quantity, IsShortAndHasAUnit) {
  EXPECT_EQ(FixedText(12.345, 2), "12.35");
  EXPECT_EQ(FixedText(kNan, 2), kNoValue);
  EXPECT_EQ(FixedText(kInfinity, 2), "\xE2\x88\x9E");
  EXPECT_EQ(MeasureText(std::nullopt, 2), kNoValue);
  EXPECT_EQ(BytesText(0), "0 B");
  EXPECT_EQ(BytesText(999), "999 B");
  EXPECT_EQ(BytesText(999949), "999.9 kB");
  EXPECT_EQ(BytesText(999950), "1.00 MB");
  EXPECT_EQ(BytesText(~uint64_t{0}), "18446744073.71 GB");
  EXPECT_EQ(SecondsText(9.994), "9.99 s");
  EXPECT_EQ(SecondsText(32.04), "32.0 s");
  EXPECT_EQ(SecondsText(230), "3 min 50 s");
  EXPECT_EQ(SecondsText(3599.6), "1 h 0 min");
  EXPECT_EQ(SecondsText(kNan), kNoValue);
  EXPECT_EQ(CountText(136912448), "136.9 M");
  EXPECT_EQ(CountText(0), "0");
  EXPECT_EQ(ShortText(0.00047, 3), "0.00047");
  EXPECT_EQ(ShortText(0.1 + 0.2, 6), "0.3");
  EXPECT_EQ(ShortText(1234.6, 3), "1235");
  EXPECT_EQ(ShortText(100, 3), "100");
  EXPECT_EQ(SignedText(-1.2, 1),
            "\xE2\x88\x92"
            "1.2");
  EXPECT_EQ(SignedText(0.3, 2), "+0.30");
  EXPECT_EQ(SignedText(-0.001, 2),
            "\xC2\xB1"
            "0.00");
}

TEST(RoundTicks, AreRoundAndInside) {
  EXPECT_THAT(RoundTicks(0, 10, 5), ElementsAre(0, 2, 4, 6, 8, 10));
  EXPECT_THAT(RoundTicks(3, 3, 5), ElementsAre(3));
  for (const auto& [low, high] : {std::pair{0.0, 1e-9}, {-7.3, 12e9}, {1e15, 1e15 + 4}}) {
    const std::vector<double> ticks = RoundTicks(low, high, 6);
    EXPECT_GE(ticks.size(), 2u) << low;
    EXPECT_LE(ticks.size(), 14u) << low;
    for (const double tick : ticks) {
      EXPECT_GE(tick, low);
      EXPECT_LE(tick, high + 1e-6 * (high - low));
    }
  }
}

std::string Drawn(LinePlot plot) {
  plot.title = "Title <&>";
  plot.summary = "Summary \"'";
  Html html;
  AddLinePlot(plot, &html);
  const std::string text = html.Take();
  EXPECT_TRUE(WellFormed(text)) << text;
  EXPECT_THAT(text, Not(HasSubstr("nan")));
  EXPECT_THAT(text, Not(HasSubstr("inf")));
  return text;
}

TEST(LinePlot, SaysSoWhereThereIsNothingToDraw) {
  LinePlot plot;
  EXPECT_THAT(Drawn(plot), HasSubstr("nothing to plot"));
  plot.lines = {{"empty", {}, false}, {"no numbers", {{1, kNan}, {kInfinity, 2}}, false}};
  EXPECT_THAT(Drawn(plot), HasSubstr("nothing to plot"));
  plot.log_y = true;
  plot.lines = {{"not above zero", {{1, 0}, {2, -1}}, false}};
  EXPECT_THAT(Drawn(plot), HasSubstr("nothing to plot"));
}

TEST(LinePlot, DrawsOnePoint) {
  LinePlot plot;
  plot.lines = {{"one", {{0, 0}}, false, 2}};
  EXPECT_THAT(Drawn(plot), HasSubstr("<svg"));
  plot.from_zero_x = false;
  plot.lines = {{"one", {{1e-12, 1e12}}, false}};
  EXPECT_THAT(Drawn(plot), HasSubstr("<svg"));
}

TEST(LinePlot, LeavesOutPointsThatAreNotFinite) {
  LinePlot plot;
  plot.lines = {{"holes", {{0, 1}, {1, kNan}, {2, kInfinity}, {3, -kInfinity}, {4, 2}}, false}};
  const std::string text = Drawn(plot);
  // The line has the two points that are left: one move, one step.
  const size_t line = text.find("class=\"line c0 d0\"");
  ASSERT_NE(line, std::string::npos);
  const std::string path = text.substr(line, text.find("/>", line) - line);
  EXPECT_EQ(Count(path, "M"), 1u);
  EXPECT_EQ(Count(path, "L"), 1u);
}

// Every number of an attribute like x="..." or cx="...".
std::vector<double> Numbers(const std::string& text, const std::string& attribute) {
  std::vector<double> numbers;
  const std::string lead = " " + attribute + "=\"";
  for (size_t at = text.find(lead); at != std::string::npos; at = text.find(lead, at + 1))
    numbers.push_back(std::stod(text.substr(at + lead.size())));
  return numbers;
}

TEST(LinePlot, KeepsEverythingInsideTheFrame) {
  for (const double scale : {1e-6, 1.0, 1e7}) {
    LinePlot plot;
    for (int line = 0; line < 15; ++line) {
      PlotLine drawn{"line " + std::to_string(line), {}, line > 2};
      for (int i = 0; i < 200; ++i) drawn.points.push_back({i * scale, std::sin(i + line) * scale});
      plot.lines.push_back(std::move(drawn));
    }
    plot.rules = {{true, 250 * scale, "budget"}, {false, 2 * scale, "target"}, {true, kNan, "no"}};
    const std::string text = Drawn(plot);
    EXPECT_THAT(text, HasSubstr("budget"));
    EXPECT_THAT(text, HasSubstr("target"));
    EXPECT_THAT(text, Not(HasSubstr(">no<")));
    for (const char* attribute : {"x", "x1", "x2"}) {
      for (const double x : Numbers(text, attribute)) {
        EXPECT_GE(x, 0);
        EXPECT_LE(x, 600);
      }
    }
    for (const char* attribute : {"y", "y1", "y2"}) {
      for (const double y : Numbers(text, attribute)) {
        EXPECT_GE(y, 0);
        EXPECT_LE(y, 330);
      }
    }
    EXPECT_EQ(Count(text, "<li>"), 15u);
  }
}

TEST(LinePlot, HasTicksOnALogarithmicAxis) {
  LinePlot plot;
  plot.log_y = true;
  plot.lines = {{"error", {{1, 0.5}, {2, 0.02}, {3, 0}}, false}};
  const std::string text = Drawn(plot);
  for (const char* tick : {">0.5<", ">0.1<", ">0.05<", ">0.02<"})
    EXPECT_THAT(text, HasSubstr(tick));
  plot.lines = {{"error", {{1, 0.0061}, {2, 0.0067}}, false}};
  EXPECT_THAT(Drawn(plot), HasSubstr(">0.0064<"));
}

TEST(Table, MarksInWordsAndEscapesEverything) {
  Table table;
  table.caption = "<caption>";
  table.heads = {"<head>", "b"};
  table.rows = {{"<row>", {{"<cell>", "worst", "worst"}}},
                {std::string(5000, 'x'), {{"1", "", "", 7.0}}}};
  Html html;
  AddTable(table, &html);
  const std::string text = html.Take();
  EXPECT_TRUE(WellFormed(text)) << text;
  EXPECT_THAT(text, HasSubstr("&lt;cell&gt; <small>worst</small>"));
  EXPECT_THAT(text, HasSubstr("<th scope=\"row\">&lt;row&gt;</th>"));
  EXPECT_THAT(text, HasSubstr("width=\"100.00%\""));  // a share above 1 is cut
}

TEST(Base64, PadsAsRfc4648) {
  const auto encode = [](std::string_view text) {
    return Base64({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
  };
  EXPECT_EQ(encode(""), "");
  EXPECT_EQ(encode("f"), "Zg==");
  EXPECT_EQ(encode("fo"), "Zm8=");
  EXPECT_EQ(encode("foobar"), "Zm9vYmFy");
  EXPECT_EQ(encode("\xFF\xEF\xBE"), "/+++");
}

TEST(EncodePng, LeavesNoFileBehind) {
  const std::string path = testing::TempDir() + "/report_test.png";
  const float grey[] = {0, 0.5f, 1, std::numeric_limits<float>::quiet_NaN()};
  const auto png = EncodePng(path, 2, 2, 1, grey);
  ASSERT_TRUE(png) << png.error().message;
  EXPECT_THAT(PngDataUri(*png), testing::StartsWith("data:image/png;base64,iVBORw0KGgo"));
  EXPECT_FALSE(std::filesystem::exists(path));
  EXPECT_FALSE(EncodePng(path + "/no/such/folder.png", 2, 2, 1, grey));
}

}  // namespace
}  // namespace patina
