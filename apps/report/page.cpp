#include "apps/report/page.h"

#include <stdexcept>

// Files of the folder HS_REPORT_WEB as they are, one after the other.
#define HS_FILE(file) ".incbin \"" HS_REPORT_WEB "/" file "\"\n"
#define HS_EMBED(name, files)                                                     \
  asm(".pushsection .rodata\nhs_report_" name "_begin:\n" files "hs_report_" name \
      "_end:\n"                                                                   \
      ".popsection\n")
HS_EMBED("page", HS_FILE("page.html"));
HS_EMBED("style", HS_FILE("style.css"));
HS_EMBED("script",
         HS_FILE("data.js") HS_FILE("charts.js") HS_FILE("scene.js") HS_FILE("parts.js")
             HS_FILE("map_lines.js") HS_FILE("map_section.js") HS_FILE("timeline_section.js")
                 HS_FILE("ground_sections.js") HS_FILE("run_sections.js") HS_FILE("live_tables.js")
                     HS_FILE("now_section.js") HS_FILE("main.js") HS_FILE("live.js"));
#undef HS_EMBED
#undef HS_FILE

extern "C" {
extern const char hs_report_page_begin[], hs_report_page_end[];
extern const char hs_report_style_begin[], hs_report_style_end[];
extern const char hs_report_script_begin[], hs_report_script_end[];
}

namespace hybrid_slam {
namespace {

std::string_view text_between(const char* begin, const char* end) {
  return {begin, static_cast<std::size_t>(end - begin)};
}

// In the page's text, or its JSON within <script>: no tag begins or ends there.
std::string without_tags(std::string_view text, std::string_view instead) {
  std::string safe;
  safe.reserve(text.size() + 64);
  for (const char c : text) {
    if (c == '<') {
      safe += instead;
    } else {
      safe += c;
    }
  }
  return safe;
}

// Wherever the page has the place.
void fill(std::string& page, std::string_view place, std::string_view content) {
  std::size_t at = page.find(place);
  if (at == std::string::npos) throw std::logic_error("the report's page lacks a place for a part");
  for (; at != std::string::npos; at = page.find(place, at + content.size())) {
    page.replace(at, place.size(), content);
  }
}

}  // namespace

std::string report_page(std::string_view title, std::string_view data, PageOrigin origin) {
  std::string page(text_between(hs_report_page_begin, hs_report_page_end));
  fill(page, "/*SERVER*/", origin == PageOrigin::kServer ? "; connect-src 'self'" : "");
  fill(page, "/*TITLE*/", without_tags(title, "&lt;"));
  fill(page, "/*STYLE*/", text_between(hs_report_style_begin, hs_report_style_end));
  fill(page, "/*SCRIPT*/", text_between(hs_report_script_begin, hs_report_script_end));
  fill(page, "/*DATA*/", without_tags(data, "\\u003c"));
  return page;
}

}  // namespace hybrid_slam
