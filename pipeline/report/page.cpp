#include "pipeline/report/page.h"

#include "pipeline/report/embedded_style.h"

namespace patina {

Html BeginPage(const std::string& title) {
  Html html;
  html.Open("html", {{"lang", "en"}});
  html.Open("head");
  html.AddEmpty("meta", {{"charset", "utf-8"}});
  // What the page promises, for the browser to hold it to.
  html.AddEmpty("meta",
                {{"http-equiv", "Content-Security-Policy"},
                 {"content", "default-src 'none'; img-src data:; style-src 'unsafe-inline'"}});
  html.AddEmpty("meta", {{"name", "viewport"}, {"content", "width=device-width, initial-scale=1"}});
  html.AddEmpty("meta", {{"name", "color-scheme"}, {"content", "light dark"}});
  html.Add("title", title);
  for (int i = 0; i < kEmbeddedStyleCount; ++i) html.AddStyle(kEmbeddedStyles[i].text);
  html.Close();
  html.Open("body").Open("main");
  return html;
}

std::string FinishPage(Html html) {
  html.Close().Close().Close();
  return "<!DOCTYPE html>\n" + html.Take();
}

void OpenSection(const char* id, const std::string& heading, Html* html) {
  html->Open("section", {{"id", id}});
  html->Add("h2", heading);
}

}  // namespace patina
