// SPDX-License-Identifier: GPL-3.0-or-later
#include "formats.hpp"

#include <string_view>
#include <utility>

#include "../formats/candump_log.hpp"
#include "../formats/csv.hpp"
#include "../formats/json_lines.hpp"
#include "../formats/mcap/mcap_sink.hpp"
#include "../formats/native.hpp"
#include "../formats/packets/pcapng_sink.hpp"
#include "detected_source.hpp"
#include "r4link/error.hpp"

namespace r4::tool {

std::string called(const std::string& path) { return path == "-" ? "standard input" : path; }

std::unique_ptr<Source> make_source(const std::string& path, RecordingVisitor& visitor,
                                    const SourceOptions& options) {
  for (const std::string_view ending : {".csv", ".jsonl"}) {
    if (path.ends_with(ending)) {
      throw Error(ErrorKind::usage, path, std::string(ending) + " cannot be read, only written",
                  "convert the original recording");
    }
  }
  return std::make_unique<DetectedSource>(visitor, called(path), options);
}

std::unique_ptr<Sink> make_sink(const std::string& path, Output& output,
                                std::vector<Device> devices) {
  const std::string_view name = path;
  if (name.ends_with(".csv")) return std::make_unique<CsvSink>(output, std::move(devices));
  if (name.ends_with(".jsonl")) return std::make_unique<JsonLinesSink>(output, std::move(devices));
  if (name.ends_with(".mcap")) return std::make_unique<McapSink>(output, std::move(devices));
  if (!devices.empty()) {
    throw Error(ErrorKind::usage, "--device",
                "this format holds only the bytes as the board sent them",
                "convert to .csv, .jsonl or .mcap");
  }
  if (name.ends_with(".r4log")) return std::make_unique<NativeSink>(output, false);
  if (name.ends_with(".r4log.zst")) return std::make_unique<NativeSink>(output, true);
  if (name.ends_with(".log")) return std::make_unique<CandumpSink>(output);
  if (name.ends_with(".pcapng")) return std::make_unique<PcapngSink>(output);
  throw Error(ErrorKind::usage, path, "the ending of the name is not known",
              "use .r4log, .r4log.zst, .csv, .jsonl, .log, .pcapng or .mcap");
}

}  // namespace r4::tool
