// SPDX-License-Identifier: GPL-3.0-or-later
// Another participant in a ROS 2 graph, with Fast DDS. The peer reads and writes bytes, whose form
// only the test defines. integration/test_ros2.py sends the peer lines on stdin and reads JSON, one
// object per line, from stdout:
//
//     reader TOPIC TYPE RELIABILITY DURABILITY USERDATA    {"type":"sample","topic":…,"bytes":"0001…"}
//     writer TOPIC TYPE RELIABILITY DURABILITY USERDATA    {"type":"matched","topic":…,"readers":1}
//     write TOPIC BYTES              {"type":"written","topic":…}
//     remove TOPIC                   {"type":"removed","topic":…}
//     crowd TOPIC TYPE COUNT         COUNT more readers, whose samples are counted
//     count TOPIC                    {"type":"counted","topic":…,"least":3,"most":4}: samples per reader
//
// RELIABILITY is reliable or best_effort, DURABILITY is volatile or transient_local, USERDATA is a
// text or -. The peer also reports the endpoints of other participants,
// {"type":"endpoint","kind":"writer","topic":…,"of":…,"user_data":…,"gid":…}, with "gone":true when
// they end. The peer reports the participants, {"type":"participant","user_data":…,"gone":…}. The
// domain is ROS_DOMAIN_ID. The peer is set up as rmw_fastrtps sets up Fast DDS:
//     ROS_AUTOMATIC_DISCOVERY_RANGE   not set      ROS_LOCALHOST_ONLY=1 of Humble: only 127.0.0.1
//                                     LOCALHOST    from Iron on: all addresses, no multicast
//                                     SUBNET       the default of ROS
//     ROS_STATIC_PEERS                an address of another computer
#if __has_include(<fastdds/utils/IPLocator.hpp>)
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.hpp>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.hpp>
#include <fastdds/utils/IPLocator.hpp>
#define FAST_DDS_3
#else
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#endif

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

namespace {

using namespace eprosima::fastdds::dds;  // NOLINT(google-build-using-namespace)
#ifdef FAST_DDS_3
namespace rtps = eprosima::fastdds::rtps;
const ReturnCode_t ok = RETCODE_OK;
#else
namespace rtps = eprosima::fastrtps::rtps;
const ReturnCode_t ok = ReturnCode_t::RETCODE_OK;
#endif
using Bytes = std::vector<std::uint8_t>;

std::mutex output;

void print(const std::string& object) {
  const std::lock_guard lock(output);
  std::cout << object << std::endl;
}

std::string hex(const std::uint8_t* bytes, std::size_t size) {
  static const char* const digits = "0123456789abcdef";
  std::string text;
  for (std::size_t i = 0; i < size; ++i) {
    text += digits[bytes[i] >> 4];
    text += digits[bytes[i] & 0xF];
  }
  return text;
}

Bytes from_hex(const std::string& text) {
  Bytes bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2) {
    bytes.push_back(static_cast<std::uint8_t>(std::stoi(text.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

std::string in_quotes(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) quoted += c >= ' ' && c <= '~' && c != '"' && c != '\\' ? c : '?';
  return quoted + '"';
}

// A type whose samples are bytes, including the four bytes of the encapsulation.
class RawType final : public TopicDataType {
 public:
#ifdef FAST_DDS_3
  explicit RawType(const std::string& name) {
    set_name(name);
    max_serialized_type_size = 1024;
  }
  bool serialize(const void* data, rtps::SerializedPayload_t& payload,
                 DataRepresentationId_t /*form*/) override {
    return write(*static_cast<const Bytes*>(data), payload);
  }
  bool deserialize(rtps::SerializedPayload_t& payload, void* data) override {
    return read(payload, *static_cast<Bytes*>(data));
  }
  std::uint32_t calculate_serialized_size(const void* data,
                                          DataRepresentationId_t /*form*/) override {
    return static_cast<std::uint32_t>(static_cast<const Bytes*>(data)->size());
  }
  void* create_data() override { return new Bytes(); }
  void delete_data(void* data) override { delete static_cast<Bytes*>(data); }
  bool compute_key(rtps::SerializedPayload_t& /*payload*/, rtps::InstanceHandle_t& /*handle*/,
                   bool /*md5*/) override {
    return false;
  }
  bool compute_key(const void* /*data*/, rtps::InstanceHandle_t& /*handle*/,
                   bool /*md5*/) override {
    return false;
  }
#else
  explicit RawType(const std::string& name) {
    setName(name.c_str());
    m_typeSize = 1024;
    m_isGetKeyDefined = false;
  }
  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    return write(*static_cast<const Bytes*>(data), *payload);
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    return read(*payload, *static_cast<Bytes*>(data));
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<Bytes*>(data)->size()); };
  }
  void* createData() override { return new Bytes(); }
  void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
  bool getKey(void* /*data*/, rtps::InstanceHandle_t* /*handle*/, bool /*md5*/) override {
    return false;
  }
#endif

 private:
  static bool write(const Bytes& bytes, rtps::SerializedPayload_t& payload) {
    if (bytes.size() > payload.max_size) return false;
    std::memcpy(payload.data, bytes.data(), bytes.size());
    payload.length = static_cast<std::uint32_t>(bytes.size());
    return true;
  }
  static bool read(const rtps::SerializedPayload_t& payload, Bytes& bytes) {
    bytes.assign(payload.data, payload.data + payload.length);
    return true;
  }
};

std::string gid_of(const rtps::GUID_t& guid) {
  return hex(guid.guidPrefix.value, 12) + hex(guid.entityId.value, 4);
}

template <class Octets>
std::string text_of(const Octets& octets) {
  return {octets.begin(), octets.end()};
}

class Graph final : public DomainParticipantListener {
 public:
#ifdef FAST_DDS_3
  void on_data_writer_discovery(DomainParticipant* /*participant*/,
                                rtps::WriterDiscoveryStatus status,
                                const PublicationBuiltinTopicData& info,
                                bool& /*ignored*/) override {
    tell("writer", info.topic_name.to_string(), info.type_name.to_string(), info.user_data,
         info.guid, status != rtps::WriterDiscoveryStatus::REMOVED_WRITER);
  }
  void on_data_reader_discovery(DomainParticipant* /*participant*/,
                                rtps::ReaderDiscoveryStatus status,
                                const SubscriptionBuiltinTopicData& info,
                                bool& /*ignored*/) override {
    tell("reader", info.topic_name.to_string(), info.type_name.to_string(), info.user_data,
         info.guid, status != rtps::ReaderDiscoveryStatus::REMOVED_READER);
  }
  void on_participant_discovery(DomainParticipant* /*participant*/,
                                rtps::ParticipantDiscoveryStatus status,
                                const ParticipantBuiltinTopicData& info,
                                bool& /*ignored*/) override {
    using Status = rtps::ParticipantDiscoveryStatus;
    tell_participant(info.user_data, status == Status::DISCOVERED_PARTICIPANT ||
                                         status == Status::CHANGED_QOS_PARTICIPANT);
  }
#else
  void on_publisher_discovery(DomainParticipant* /*participant*/,
                              rtps::WriterDiscoveryInfo&& info) override {
    tell("writer", info.info.topicName().to_string(), info.info.typeName().to_string(),
         info.info.m_qos.m_userData, info.info.guid(),
         info.status != rtps::WriterDiscoveryInfo::REMOVED_WRITER);
  }
  void on_subscriber_discovery(DomainParticipant* /*participant*/,
                               rtps::ReaderDiscoveryInfo&& info) override {
    tell("reader", info.info.topicName().to_string(), info.info.typeName().to_string(),
         info.info.m_qos.m_userData, info.info.guid(),
         info.status != rtps::ReaderDiscoveryInfo::REMOVED_READER);
  }
  void on_participant_discovery(DomainParticipant* /*participant*/,
                                rtps::ParticipantDiscoveryInfo&& info) override {
    using Info = rtps::ParticipantDiscoveryInfo;
    tell_participant(info.info.m_userData, info.status == Info::DISCOVERED_PARTICIPANT ||
                                               info.status == Info::CHANGED_QOS_PARTICIPANT);
  }
#endif

 private:
  template <class Octets>
  static void tell_participant(const Octets& user_data, bool there) {
    print(R"({"type":"participant","user_data":)" + in_quotes(text_of(user_data)) + R"(,"gone":)" +
          (there ? "false" : "true") + "}");
  }
  template <class Octets>
  static void tell(const char* kind, const std::string& topic, const std::string& type,
                   const Octets& user_data, const rtps::GUID_t& guid, bool there) {
    print(std::string(R"({"type":"endpoint","kind":")") + kind + R"(","topic":)" +
          in_quotes(topic) + R"(,"of":)" + in_quotes(type) + R"(,"user_data":)" +
          in_quotes(text_of(user_data)) + R"(,"gid":)" + in_quotes(gid_of(guid)) + R"(,"gone":)" +
          (there ? "false" : "true") + "}");
  }
};

class Samples final : public DataReaderListener {
 public:
  void on_data_available(DataReader* reader) override {
    Bytes bytes;
    SampleInfo info;
    while (reader->take_next_sample(&bytes, &info) == ok) {
      if (!info.valid_data) continue;
      print(R"({"type":"sample","topic":)" + in_quotes(reader->get_topicdescription()->get_name()) +
            R"(,"bytes":)" + in_quotes(hex(bytes.data(), bytes.size())) + "}");
    }
  }
};

class Count final : public DataReaderListener {
 public:
  void on_data_available(DataReader* reader) override {
    Bytes bytes;
    SampleInfo info;
    while (reader->take_next_sample(&bytes, &info) == ok) ++samples;
  }
  std::atomic<int> samples{0};
};

class Matches final : public DataWriterListener {
 public:
  void on_publication_matched(DataWriter* writer, const PublicationMatchedStatus& status) override {
    print(R"({"type":"matched","topic":)" + in_quotes(writer->get_topic()->get_name()) +
          R"(,"readers":)" + std::to_string(status.current_count) + "}");
  }
};

template <class Q>
void set(Q& qos, const std::string& reliability, const std::string& durability,
         const std::string& user_data) {
  qos.endpoint().history_memory_policy = rtps::DYNAMIC_RESERVE_MEMORY_MODE;
  qos.reliability().kind =
      reliability == "reliable" ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
  qos.durability().kind =
      durability == "volatile" ? VOLATILE_DURABILITY_QOS : TRANSIENT_LOCAL_DURABILITY_QOS;
  qos.history().kind = KEEP_LAST_HISTORY_QOS;
  qos.history().depth = 10;
  if (user_data != "-") {
    qos.user_data().data_vec(std::vector<rtps::octet>(user_data.begin(), user_data.end()));
  }
}

class Peer {
 public:
  Peer() {
    DomainParticipantQos qos;
    const char* const range = std::getenv("ROS_AUTOMATIC_DISCOVERY_RANGE");
    if (range == nullptr || std::strcmp(range, "LOCALHOST") == 0) {
      qos.transport().use_builtin_transports = false;
      const auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
      if (range == nullptr) {
        udp->interfaceWhiteList.emplace_back("127.0.0.1");
      } else {
        udp->maxInitialPeersRange = 32;
        qos.wire_protocol().builtin.metatrafficUnicastLocatorList.push_back(rtps::Locator_t());
        qos.transport().user_transports.push_back(
            std::make_shared<eprosima::fastdds::rtps::SharedMemTransportDescriptor>());
      }
      qos.transport().user_transports.push_back(udp);
      rtps::Locator_t here;
      rtps::IPLocator::setIPv4(here, 127, 0, 0, 1);
      qos.wire_protocol().builtin.initialPeersList.push_back(here);
    }
    if (const char* const address = std::getenv("ROS_STATIC_PEERS"); address != nullptr) {
      rtps::Locator_t there;
      rtps::IPLocator::setIPv4(there, address);
      qos.wire_protocol().builtin.initialPeersList.push_back(there);
    }
    const std::string enclave = "enclave=/;";
    qos.user_data().data_vec(std::vector<rtps::octet>(enclave.begin(), enclave.end()));
    const char* const domain = std::getenv("ROS_DOMAIN_ID");
    participant_ = DomainParticipantFactory::get_instance()->create_participant(
        domain == nullptr ? 0 : static_cast<std::uint32_t>(std::stoul(domain)), qos, &graph_,
        StatusMask::none());
    publisher_ = participant_->create_publisher(PUBLISHER_QOS_DEFAULT);
    subscriber_ = participant_->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  }
  ~Peer() {
    participant_->delete_contained_entities();
    DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  void obey(const std::string& line) {
    std::istringstream words(line);
    std::string what;
    std::string topic;
    words >> what >> topic;
    if (what == "write") {
      std::string bytes;
      words >> bytes;
      Bytes sample = from_hex(bytes);
      writers_.at(topic)->write(&sample);
      print(R"({"type":"written","topic":)" + in_quotes(topic) + "}");
      return;
    }
    if (what == "count") {
      const auto [least, most] =
          std::minmax_element(crowd_.begin(), crowd_.end(),
                              [](const auto& a, const auto& b) { return a->samples < b->samples; });
      print(R"({"type":"counted","topic":)" + in_quotes(topic) + R"(,"least":)" +
            std::to_string((*least)->samples) + R"(,"most":)" + std::to_string((*most)->samples) +
            "}");
      return;
    }
    if (what == "remove") {
      publisher_->delete_datawriter(writers_.at(topic));
      writers_.erase(topic);
      print(R"({"type":"removed","topic":)" + in_quotes(topic) + "}");
      return;
    }
    std::string type;
    std::string reliability;
    std::string durability;
    std::string user_data;
    int count = 0;
    if (what == "crowd") {
      words >> type >> count;
      for (int i = 0; i < count; ++i) {
        DataReaderQos qos;
        set(qos, "reliable", "volatile", "-");
        crowd_.push_back(std::make_unique<Count>());
        subscriber_->create_datareader(made_topic(topic, type), qos, crowd_.back().get(),
                                       StatusMask::all());
      }
      return;
    }
    words >> type >> reliability >> durability >> user_data;
    Topic* const made = made_topic(topic, type);
    if (what == "reader") {
      DataReaderQos qos;
      set(qos, reliability, durability, user_data);
      subscriber_->create_datareader(made, qos, &samples_, StatusMask::all());
    } else {
      DataWriterQos qos;
      set(qos, reliability, durability, user_data);
      writers_[topic] = publisher_->create_datawriter(made, qos, &matches_, StatusMask::all());
    }
  }

 private:
  Topic* made_topic(const std::string& topic, const std::string& type) {
    Topic*& made = topics_[topic];
    if (made != nullptr) return made;
    TypeSupport(new RawType(type)).register_type(participant_);
    return made = participant_->create_topic(topic, type, TOPIC_QOS_DEFAULT);
  }

  Graph graph_;
  Samples samples_;
  std::vector<std::unique_ptr<Count>> crowd_;
  Matches matches_;
  DomainParticipant* participant_ = nullptr;
  Publisher* publisher_ = nullptr;
  Subscriber* subscriber_ = nullptr;
  std::map<std::string, Topic*> topics_;
  std::map<std::string, DataWriter*> writers_;
};

}  // namespace

int main() {
  Peer peer;
  for (std::string line; std::getline(std::cin, line);) peer.obey(line);
  return 0;
}
