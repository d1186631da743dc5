#include <sqlite3.h>

#include <map>

#include "cameras/files/printable.h"
#include "frontend/input/bags/bag.h"

// rosbag2's sqlite3 storage: a table of topics, and one of messages with the serialised bytes.
namespace hybrid_slam {

namespace {

using Database = std::unique_ptr<sqlite3, int (*)(sqlite3*)>;
using Statement = std::unique_ptr<sqlite3_stmt, int (*)(sqlite3_stmt*)>;

class SqliteBag final : public Bag {
 public:
  explicit SqliteBag(const std::filesystem::path& path)
      : Bag(path.string()), database_(nullptr, sqlite3_close) {
    open(path, "mode=ro");
    // A write-ahead log wants a folder that can be written to, unless nobody else has the file.
    if (!has_table()) open(path, "mode=ro&immutable=1");
    if (!has_table()) accept_cut_file();
    if (!has_table()) {
      throw InputError(name() + ": no bag of ROS 2: " + fault());
    }
    list_topics();
    list_messages();
  }

 private:
  void open(const std::filesystem::path& path, const std::string& how) {
    std::string uri = "file:";
    for (const char c : std::filesystem::absolute(path).string()) {
      constexpr char kHex[] = "0123456789abcdef";
      const auto byte = static_cast<unsigned char>(c);
      const bool is_plain = c != '%' && c != '?' && c != '#';
      uri += is_plain ? std::string(1, c) : std::string{'%', kHex[byte >> 4], kHex[byte & 15]};
    }
    sqlite3* handle = nullptr;
    // FULLMUTEX: the library lets threads share the connection.
    const int flags = SQLITE_OPEN_READONLY | SQLITE_OPEN_URI | SQLITE_OPEN_FULLMUTEX;
    const int error = sqlite3_open_v2((uri + '?' + how).c_str(), &handle, flags, nullptr);
    database_.reset(handle);
    if (error != SQLITE_OK) throw InputError(name() + ": cannot be read");
  }

  // SQLite refuses a file with fewer pages than it had, unless it is to be repaired.
  void accept_cut_file() {
    if (sqlite3_errcode(database_.get()) != SQLITE_CORRUPT) return;
    sqlite3_db_config(database_.get(), SQLITE_DBCONFIG_WRITABLE_SCHEMA, 1, nullptr);
    if (has_table()) warn("is cut off; what can be read is read");
  }

  // SQLite's words on what went wrong, in which names of the file may stand.
  std::string fault() const { return printable(sqlite3_errmsg(database_.get())); }

  Statement prepare(const char* sql) const {
    sqlite3_stmt* statement = nullptr;
    sqlite3_prepare_v2(database_.get(), sql, -1, &statement, nullptr);
    return {statement, sqlite3_finalize};
  }

  bool has_table() const {
    const Statement statement =
        prepare("SELECT count(*) FROM sqlite_master WHERE name IN ('topics', 'messages')");
    return statement && sqlite3_step(statement.get()) == SQLITE_ROW &&
           sqlite3_column_int(statement.get(), 0) >= 2;
  }

  void list_topics() {
    const Statement rows = prepare("SELECT id, name, type, serialization_format FROM topics");
    if (!rows) throw InputError(name() + ": no bag of ROS 2: " + fault());
    const auto text = [&](int column) {
      const auto* const value = sqlite3_column_text(rows.get(), column);
      return value ? std::string(reinterpret_cast<const char*>(value)) : std::string();
    };
    int result = SQLITE_ROW;
    while ((result = sqlite3_step(rows.get())) == SQLITE_ROW) {
      topic_ids_[sqlite3_column_int64(rows.get(), 0)] = topic_of(
          text(1), text(2), text(3) == "cdr" ? Serialization::kCdr : Serialization::kOther);
    }
    if (result != SQLITE_DONE) {
      throw InputError(name() + ": " + fault());
    }
  }

  void list_messages() {
    const Statement rows = prepare("SELECT id, topic_id FROM messages ORDER BY id");
    if (!rows) throw InputError(name() + ": no bag of ROS 2: " + fault());
    int result = SQLITE_ROW;
    while ((result = sqlite3_step(rows.get())) == SQLITE_ROW) {
      const auto found = topic_ids_.find(sqlite3_column_int64(rows.get(), 1));
      if (found == topic_ids_.end()) continue;
      count_messages(found->second, 1);
      const auto id = static_cast<std::uint64_t>(sqlite3_column_int64(rows.get(), 0));
      if (is_wanted(found->second)) add_message({found->second, 0, id});
    }
    if (result != SQLITE_DONE) {
      warn("is cut off or damaged (" + fault() + "); what can be read is read");
    }
  }

  ByteVector read_stored(const BagMessage& message, std::uint64_t most) const override {
    sqlite3_blob* handle = nullptr;
    const int error = sqlite3_blob_open(database_.get(), "main", "messages", "data",
                                        static_cast<sqlite3_int64>(message.offset), 0, &handle);
    const std::unique_ptr<sqlite3_blob, int (*)(sqlite3_blob*)> blob(handle, sqlite3_blob_close);
    if (error == SQLITE_OK) {
      const auto size = static_cast<std::uint64_t>(sqlite3_blob_bytes(handle));
      ByteVector bytes(std::min(size, most));
      if (sqlite3_blob_read(handle, bytes.data(), static_cast<int>(bytes.size()), 0) == SQLITE_OK) {
        return bytes;
      }
    }
    throw InputError(name() + ": a message cannot be read: it is cut off or damaged");
  }

  Database database_;
  std::map<sqlite3_int64, std::uint32_t> topic_ids_;
};

}  // namespace

std::unique_ptr<const Bag> open_sqlite_bag(const std::filesystem::path& path) {
  return std::make_unique<const SqliteBag>(path);
}

}  // namespace hybrid_slam
