#pragma once

#include <string>
#include <string_view>

namespace hybrid_slam {

// Whether the page is a file that asks for nothing, or may ask the server that it came from.
enum class PageOrigin { kFile, kServer };

// The report's page with its data inside: one HTML file that needs nothing else. `data`: JSON;
// docs/report.md says what is in it. `title`: plain text.
std::string report_page(std::string_view title, std::string_view data,
                        PageOrigin origin = PageOrigin::kFile);

}  // namespace hybrid_slam
