#include "frontend/input/trajectory_file.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "frontend/input/pose_rows.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kTumColumns = 8;
constexpr std::size_t kKittiColumns = 12;
constexpr std::size_t kEurocColumns = 17;
constexpr double kNanosecond = 1e-9;  // [s]

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

// The component that a column's name stands for ("qx", "q_RS_w", "orientation.y"), or 0.
char quaternion_component(std::string_view name) {
  if (name.empty() || std::string_view("wxyz").find(name.back()) == std::string_view::npos) {
    return 0;
  }
  const bool is_quaternion = name.front() == 'q' || name.find("quat") != std::string_view::npos ||
                             name.find("orient") != std::string_view::npos ||
                             name.find("rot") != std::string_view::npos;
  return is_quaternion ? name.back() : '\0';
}

QuaternionOrder order_of_header(const std::string& header) {
  std::string components;
  const std::string names = lower(header);
  for (const std::string_view name : split_fields(names, ' ')) {
    if (const char component = quaternion_component(name)) components += component;
  }
  if (components == "xyzw") return QuaternionOrder::kXyzw;
  if (components == "wxyz") return QuaternionOrder::kWxyz;
  return QuaternionOrder::kUnknown;
}

// In which order the first rotation is none at all.
QuaternionOrder order_of_identity(const NumberRow& row) {
  constexpr double kOne = 1 - 1e-6;  // files are written with few digits
  if (std::abs(row.values[7]) > kOne) return QuaternionOrder::kXyzw;
  if (std::abs(row.values[4]) > kOne) return QuaternionOrder::kWxyz;
  return QuaternionOrder::kUnknown;
}

bool has_nanoseconds(const NumberTable& table) {
  const auto is_beyond = [](const NumberRow& row) {
    return std::abs(row.values[0]) >= kLeastNanoseconds;
  };
  if (std::any_of(table.rows.begin(), table.rows.end(), is_beyond)) return true;
  const auto is_whole = [](const NumberRow& row) {
    return row.values[0] == std::floor(row.values[0]);
  };
  return table.header.find("[ns]") != std::string::npos &&
         std::all_of(table.rows.begin(), table.rows.end(), is_whole);
}

// What is the custom for such a file without a header.
QuaternionOrder order_of_custom(const NumberTable& table, bool nanoseconds) {
  if (!nanoseconds) return QuaternionOrder::kXyzw;
  const bool commas = table.first_row.find(',') != std::string::npos;
  const std::string_view stamp = split_fields(table.first_row, ' ').front();
  const bool fraction = stamp.find('.') != std::string_view::npos;
  if (commas == fraction) return QuaternionOrder::kUnknown;
  return commas ? QuaternionOrder::kWxyz : QuaternionOrder::kXyzw;
}

// The order of the quaternions in a table of 8 columns: `given`, or what the file tells.
QuaternionOrder find_order(const NumberTable& table, bool nanoseconds, QuaternionOrder given,
                           const fs::path& path, std::vector<std::string>& notes) {
  if (given != QuaternionOrder::kUnknown) return given;
  const QuaternionOrder named = order_of_header(table.header);
  if (named != QuaternionOrder::kUnknown) return named;
  const bool commas = table.first_row.find(',') != std::string::npos;
  const QuaternionOrder custom = order_of_custom(table, nanoseconds);
  if (!nanoseconds && !commas) return custom;  // plainly TUM
  const QuaternionOrder identity = order_of_identity(table.rows.front());
  const bool contradiction = custom != QuaternionOrder::kUnknown &&
                             identity != QuaternionOrder::kUnknown && custom != identity;
  const QuaternionOrder found = custom != QuaternionOrder::kUnknown ? custom : identity;
  if (contradiction || found == QuaternionOrder::kUnknown) {
    throw line_error(path, table.rows.front().line,
                     "the quaternions may be x y z w or w x y z; say which by a header "
                     "(\"# t x y z qw qx qy qz\") or by an option (--help)");
  }
  notes.push_back(path.string() + ": quaternions read as " +
                  (found == QuaternionOrder::kWxyz ? "w x y z" : "x y z w"));
  return found;
}

Rigid3d pose_of(const NumberRow& row, QuaternionOrder order, const fs::path& path) {
  const std::vector<double>& v = row.values;
  const Eigen::Vector3d position(v[1], v[2], v[3]);
  const bool w_first = order == QuaternionOrder::kWxyz;
  return {w_first ? checked_rotation(v[4], v[5], v[6], v[7], path, row.line)
                  : checked_rotation(v[7], v[4], v[5], v[6], path, row.line),
          position};
}

// All rows have as many columns as the first.
void check_rows(const NumberTable& table, const fs::path& path) {
  if (table.rows.empty()) throw InputError(path.string() + ": holds no poses");
  const std::size_t columns = table.rows.front().values.size();
  for (const NumberRow& row : table.rows) {
    if (row.values.size() != columns) {
      throw line_error(path, row.line,
                       "expected " + std::to_string(columns) + " columns, found " +
                           std::to_string(row.values.size()));
    }
  }
}

void check_columns(const NumberTable& table, const fs::path& path) {
  check_rows(table, path);
  const std::size_t columns = table.rows.front().values.size();
  if (columns != kTumColumns && columns != kKittiColumns && columns != kEurocColumns) {
    throw line_error(
        path, table.rows.front().line,
        "expected 8 columns (TUM) or 12 (KITTI) or 17 (EuRoC), found " + std::to_string(columns));
  }
}

void read_stamped(const NumberTable& table, QuaternionOrder order, bool nanoseconds,
                  const fs::path& path, TrajectoryFile& result) {
  std::size_t repeated = 0;
  int first_repeated = 0;  // its line
  for (const NumberRow& row : table.rows) {
    const double time = row.values[0] * (nanoseconds ? kNanosecond : 1);
    const Rigid3d pose = pose_of(row, order, path);
    if (!result.poses.empty() && time < result.poses.back().time) {
      throw line_error(path, row.line, "times are not strictly ascending");
    }
    if (!result.poses.empty() && time == result.poses.back().time) {
      if (repeated++ == 0) first_repeated = row.line;
      continue;
    }
    result.poses.push_back({time, pose});
  }
  if (repeated > 0) {
    result.warnings.push_back(path.string() + ": " + std::to_string(repeated) + " of " +
                              std::to_string(table.rows.size()) +
                              " poses have the time of the one before (first: line " +
                              std::to_string(first_repeated) + "); the later are left out");
  }
}

}  // namespace

TrajectoryFile read_trajectory(const fs::path& path, QuaternionOrder order) {
  const NumberTable table = read_number_table(path, ' ');
  check_columns(table, path);
  TrajectoryFile result;
  const std::size_t columns = table.rows.front().values.size();
  result.has_times = columns != kKittiColumns;
  if (!result.has_times) {
    for (const NumberRow& row : table.rows) {
      result.poses.push_back({static_cast<double>(result.poses.size()), kitti_pose(row, path)});
    }
    return result;
  }
  const bool nanoseconds = has_nanoseconds(table);
  if (columns == kEurocColumns) {
    order = QuaternionOrder::kWxyz;
  } else {
    order = find_order(table, nanoseconds, order, path, result.notes);
  }
  if (nanoseconds) result.notes.push_back(path.string() + ": times read as nanoseconds");
  read_stamped(table, order, nanoseconds, path, result);
  return result;
}

TrajectoryFile read_euroc_poses(const fs::path& path) {
  const NumberTable table = read_number_table(path, ' ');
  check_rows(table, path);
  if (table.rows.front().values.size() < kTumColumns) {
    throw line_error(path, table.rows.front().line, "expected at least 8 columns");
  }
  TrajectoryFile result;
  result.has_times = true;
  const QuaternionOrder named = order_of_header(table.header);
  const bool is_named = named != QuaternionOrder::kUnknown;
  read_stamped(table, is_named ? named : QuaternionOrder::kWxyz, true, path, result);
  return result;
}

}  // namespace hybrid_slam
