// SPDX-License-Identifier: GPL-3.0-or-later
/* Test a server with the public OpenIGTLink library: stream_peer PORT BASIS
 * Use OpenIGTLink to pack each posture as a message, and to unpack the frames and verify their checksums. Compare the
 * frames with results of the run-time library. */
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include <igtlClientSocket.h>
#include <igtlMessageHeader.h>
#include <igtlNDArrayMessage.h>
#include <igtlPolyDataMessage.h>
#include <igtlPositionMessage.h>
#include <igtlQuaternionTrackingDataMessage.h>
#include <igtlStringMessage.h>
#include <igtlTransformMessage.h>

#include <supine/posture.h>
#include <supine/runtime.h>

static void expect(bool holds, const char *what) {
  if (!holds) {
    std::fprintf(stderr, "stream_peer: failed: %s\n", what);
    std::exit(1);
  }
}

static igtl::ClientSocket::Pointer peer;
static unsigned int stamp_seconds = 1000;

template <class Message> static void send(Message &message, const char *device) {
  message->SetDeviceName(device);
  message->SetTimeStamp(++stamp_seconds, 0x80000000u);
  message->Pack();
  expect(peer->Send(message->GetPackPointer(), message->GetPackSize()) != 0, "a message is sent");
}

// Receive the next message of this type that has the stamp of the last message sent.
template <class Pointer> static void receive(Pointer message, const char *type) {
  for (int i = 0; i < 10000; ++i) {
    igtl::MessageHeader::Pointer header = igtl::MessageHeader::New();
    header->InitPack();
    expect(peer->Receive(header->GetPackPointer(), header->GetPackSize()) == header->GetPackSize(),
           "a header arrives");
    header->Unpack();
    unsigned int seconds = 0;
    unsigned int fraction = 0;
    header->GetTimeStamp(&seconds, &fraction);
    if (seconds != stamp_seconds || std::strcmp(header->GetDeviceType(), type) != 0) {
      peer->Skip(header->GetBodySizeToRead(), 0);
      continue;
    }
    expect(fraction == 0x80000000u, "the time stamp of the pose");
    expect(std::strcmp(header->GetDeviceName(), "SUPINE") == 0, "the device's name");
    message->SetMessageHeader(header);
    message->AllocatePack();
    expect(peer->Receive(message->GetPackBodyPointer(), message->GetPackBodySize()) ==
               message->GetPackBodySize(),
           "a body arrives");
    expect((message->Unpack(1) & igtl::MessageHeader::UNPACK_BODY) != 0, "the checksum is right");
    return;
  }
  expect(false, "the answer arrives");
}

static supine_pose pose_of(const supine_basis *basis, const double gravity[3], double above) {
  supine_state state = {};
  supine_pose pose;
  supine_error error;
  std::copy_n(gravity, 3, state.gravity);
  state.volume = {SUPINE_VOLUME_REST, above};
  expect(supine_basis_pose(basis, &state, &pose, &error) == SUPINE_OK, "a pose");
  return pose;
}

static void expect_weights(const supine_basis *basis, const supine_pose &pose) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  igtl::NDArrayMessage::Pointer message = igtl::NDArrayMessage::New();
  receive(message, "NDARRAY");
  expect(message->GetType() == igtl::NDArrayMessage::TYPE_FLOAT32, "32-bit floats");
  const size_t modes = info->mode_count;
  const size_t count = modes + 3 * info->lung_count;
  expect(message->GetArray()->GetSize().size() == 1 && message->GetArray()->GetSize()[0] == count,
         "K + 3 G numbers");
  const float *value = static_cast<const float *>(message->GetArray()->GetRawArray());
  for (size_t i = 0; i < count; ++i) {
    const double wanted =
        i < modes ? pose.weights[i] : pose.gains[(i - modes) / 3][(i - modes) % 3];
    expect(std::fabs(value[i] - wanted) <= 1e-6 * std::fabs(wanted) + 1e-6, "weights and gains");
  }
}

typedef std::array<uint32_t, 3> Triangle;

// Return a triangle with the lowest corner first, in the same cyclic order.
static Triangle face(uint32_t a, uint32_t b, uint32_t c) {
  Triangle t = {a, b, c};
  std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  return t;
}

static void expect_surface(const supine_basis *basis, const supine_pose &pose) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  igtl::PolyDataMessage::Pointer message = igtl::PolyDataMessage::New();
  receive(message, "POLYDATA");
  expect(message->GetPoints()->GetNumberOfPoints() == static_cast<int>(info->vertex_count),
         "every vertex");
  std::vector<float> xyz(3 * info->vertex_count);
  supine_deform(basis, &pose, xyz.data());
  float moved = 0.0f;
  for (unsigned i = 0; i < info->vertex_count; ++i) {
    float point[3];
    message->GetPoints()->GetPoint(i, point);
    for (int k = 0; k < 3; ++k) { // equal: the server uses the same library on the same machine
      expect(std::fabs(point[k] - xyz[3 * i + k]) < 1e-3f, "positions");
      moved = std::fmax(moved, std::fabs(point[k] - supine_basis_vertices(basis)[3 * i + k]));
    }
  }
  expect(moved > 1.0f, "something moves");
  std::vector<Triangle> received;
  std::vector<Triangle> wanted;
  for (unsigned i = 0; i < message->GetTriangleStrips()->GetNumberOfCells(); ++i) {
    std::vector<igtlUint32> strip(message->GetTriangleStrips()->GetCellSize(i));
    message->GetTriangleStrips()->GetCell(i, strip.data());
    for (size_t j = 0; j + 2 < strip.size(); ++j) { // odd triangles of a strip have the opposite orientation
      if (strip[j] != strip[j + 1] && strip[j + 1] != strip[j + 2] && strip[j] != strip[j + 2]) {
        received.push_back(face(strip[j], strip[j + 1 + j % 2], strip[j + 2 - j % 2]));
      }
    }
  }
  const uint32_t *corner = supine_basis_triangles(basis);
  for (size_t i = 0; i < info->triangle_count; ++i, corner += 3) {
    wanted.push_back(face(corner[0], corner[1], corner[2]));
  }
  std::sort(received.begin(), received.end());
  std::sort(wanted.begin(), wanted.end());
  expect(received == wanted, "every triangle once, with its orientation");
}

// A posture, and the directions of the patient's left, back and head in a room with z upwards.
struct Lie {
  const char *posture;
  float left[3], back[3], head[3];
};
static const Lie lies[] = {{"supine", {1, 0, 0}, {0, 0, -1}, {0, 1, 0}},
                           {"prone", {-1, 0, 0}, {0, 0, 1}, {0, 1, 0}},
                           {"left", {0, 0, -1}, {-1, 0, 0}, {0, 1, 0}},
                           {"right", {0, 0, 1}, {1, 0, 0}, {0, 1, 0}}};

static void send_transform(const Lie &lie) {
  igtl::TransformMessage::Pointer message = igtl::TransformMessage::New();
  igtl::Matrix4x4 matrix;
  igtl::IdentityMatrix(matrix);
  for (int row = 0; row < 3; ++row) {
    matrix[row][0] = lie.left[row];
    matrix[row][1] = lie.back[row];
    matrix[row][2] = lie.head[row];
  }
  message->SetMatrix(matrix);
  send(message, "Patient");
}

static void say(const char *device, const char *text) {
  igtl::StringMessage::Pointer message = igtl::StringMessage::New();
  message->SetString(text);
  send(message, device);
}

int main(int count, char **word) {
  expect(count == 3, "usage: stream_peer PORT BASIS");
  supine_basis *basis = nullptr;
  supine_error error;
  expect(supine_basis_open(word[2], &basis, &error) == SUPINE_OK, error.message);
  peer = igtl::ClientSocket::New();
  expect(peer->ConnectToServer("127.0.0.1", std::atoi(word[1])) == 0, "a connection");
  peer->SetReceiveTimeout(100000);
  double gravity[3];
  for (const Lie &lie : lies) {
    send_transform(lie);
    expect(supine_posture_gravity(lie.posture, gravity) == SUPINE_OK, lie.posture);
    expect_weights(basis, pose_of(basis, gravity, 400.0));
  }
  // Send a quaternion. A standing body that rotates backwards by 90 degrees about its left-right axis becomes supine.
  const double supine[3] = {0, 1, 0};
  const float half = 0.70710678f;
  igtl::PositionMessage::Pointer position = igtl::PositionMessage::New();
  position->SetPackType(igtl::PositionMessage::ALL);
  position->SetPosition(1, 2, 3);
  position->SetQuaternion(-half, 0, 0, half);
  send(position, "Patient");
  expect_weights(basis, pose_of(basis, supine, 400.0));
  igtl::QuaternionTrackingDataMessage::Pointer tracked = igtl::QuaternionTrackingDataMessage::New();
  for (int i = 0; i < 2; ++i) { // element 0 is a probe, which is ignored; element 1 is the prone patient
    igtl::QuaternionTrackingDataElement::Pointer element =
        igtl::QuaternionTrackingDataElement::New();
    element->SetName(i == 0 ? "Probe" : "Patient");
    element->SetType(igtl::QuaternionTrackingDataElement::TYPE_6D);
    element->SetPosition(0, 0, 0);
    element->SetQuaternion(i == 0 ? 0 : half, 0, 0, i == 0 ? 1 : half);
    tracked->AddQuaternionTrackingDataElement(element);
  }
  send(tracked, "Tracker");
  const double prone[3] = {0, -1, 0};
  expect_weights(basis, pose_of(basis, prone, 400.0));
  // A message sets the volume; a number without a reference is refused and changes nothing.
  for (const char *text : {"rest+500", "500"}) {
    say("VOLUME", text);
    send_transform(lies[1]);
    expect_weights(basis, pose_of(basis, prone, 500.0));
  }
  say("VOLUME", "rest+250");
  say("SEND", "surface"); // ask for surfaces instead of weights
  for (const Lie &lie : lies) {
    send_transform(lie);
    expect(supine_posture_gravity(lie.posture, gravity) == SUPINE_OK, lie.posture);
    expect_surface(basis, pose_of(basis, gravity, 250.0));
  }
  peer->CloseSocket();
  supine_basis_close(basis);
  return 0;
}
