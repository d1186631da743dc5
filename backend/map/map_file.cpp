#include "backend/map/map_file.h"

#include "backend/map/map_decoding.h"
#include "backend/map/map_encoding.h"
#include "backend/map/map_file_format.h"
#include "backend/map/section_file.h"
#include "cameras/files/input_error.h"

namespace hybrid_slam {

void save_map(const std::filesystem::path& path, const MapSnapshot& map, const MapFileInfo& info) {
  SectionFileWriter file(path, kMapFileFormat);
  encode_map(MapFileAccess::tables(map), info, file);
  file.commit();
}

LoadedMap load_map(const std::filesystem::path& path) {
  SectionFileReader file(path, kMapFileFormat);
  LoadedMap loaded;
  loaded.map = MapFileAccess::make(decode_map(file, loaded.info));
  const std::vector<std::string> faults = loaded.map.check_consistency();
  if (!faults.empty()) throw InputError(path.string() + ": no consistent map: " + faults.front());
  return loaded;
}

}  // namespace hybrid_slam
