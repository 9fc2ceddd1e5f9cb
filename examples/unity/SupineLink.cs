// SPDX-License-Identifier: MIT
// Lungs for Unity, in one file that needs only .NET. Basis calls the run-time library by P/Invoke. Link
// exchanges OpenIGTLink messages with 'supine stream'; its thread keeps the newest frame.
// LungBehaviour.cs uses both in a scene.
using System;
using System.Net.Sockets;
using System.Runtime.InteropServices;
using System.Text;
using System.Threading;

namespace Supine
{
    /// <summary>A connection to the server 'supine stream'.</summary>
    public sealed class Link : IDisposable
    {
        const int HeaderSize = 58;
        const int Float32 = 10;
        static readonly ulong[] Table = MakeTable();
        readonly TcpClient client;
        readonly NetworkStream stream;
        readonly Thread reader;
        readonly object guard = new object();
        float[] newest;
        ulong stamp;
        bool closing;

        /// <summary>Connects, and begins to read frames.</summary>
        public Link(string host, int port)
        {
            client = new TcpClient(host, port) { NoDelay = true, ReceiveBufferSize = 8192 };
            stream = client.GetStream();
            reader = new Thread(Read) { IsBackground = true };
            reader.Start();
        }

        /// <summary>Reason why reading ended; null while it continues.</summary>
        public Exception Failure { get; private set; }

        // Returns the newest frame: the weights of the modes (for each lung, in fields over volume), then the factors
        // of each lung's displacement along x, y and z. Returns null if no frame was received since the last call.
        public float[] TakeNewest(out ulong poseStamp)
        {
            lock (guard)
            {
                float[] taken = newest;
                newest = null;
                poseStamp = stamp;
                return taken;
            }
        }

        /// <summary>Sends a pose: the row-major rotation from body axes to world axes, z up.</summary>
        public void SendPose(string device, float[] rotation, ulong poseStamp)
        {
            byte[] body = new byte[48];
            for (int column = 0; column < 3; ++column)
                for (int row = 0; row < 3; ++row)
                    PutFloat(body, 4 * (3 * column + row), rotation[3 * row + column]);
            Send("TRANSFORM", device, body, poseStamp);
        }

        /// <summary>Sets the volume: rest, full or scan, or these with mL (rest+500), or 2600mL.</summary>
        public void SetVolume(string volume)
        {
            byte[] text = Encoding.ASCII.GetBytes(volume);
            byte[] body = new byte[4 + text.Length];
            body[1] = 3; // US-ASCII
            Put(body, 2, 2, (ulong)text.Length);
            text.CopyTo(body, 4);
            Send("STRING", "VOLUME", body, 0);
        }

        public void Dispose()
        {
            closing = true;
            client.Close();
            reader.Join(1000);
        }

        void Send(string type, string device, byte[] body, ulong poseStamp)
        {
            byte[] message = new byte[HeaderSize + body.Length];
            Put(message, 0, 2, 1);
            Encoding.ASCII.GetBytes(type).CopyTo(message, 2);
            Encoding.ASCII.GetBytes(device).CopyTo(message, 14);
            Put(message, 34, 8, poseStamp);
            Put(message, 42, 8, (ulong)body.Length);
            Put(message, 50, 8, Crc(body));
            body.CopyTo(message, HeaderSize);
            stream.Write(message, 0, message.Length);
        }

        void Read()
        {
            try
            {
                byte[] header = new byte[HeaderSize];
                for (;;)
                {
                    Fill(header);
                    byte[] body = new byte[checked((int)Get(header, 42, 8))];
                    Fill(body);
                    if (Crc(body) == Get(header, 50, 8) && Name(header, 2, 12) == "NDARRAY")
                        Keep(Get(header, 34, 8), body);
                }
            }
            catch (Exception failure)
            {
                if (!closing) Failure = failure;
            }
        }

        void Fill(byte[] bytes)
        {
            for (int got = 0; got < bytes.Length;)
            {
                int count = stream.Read(bytes, got, bytes.Length - got);
                if (count == 0) throw new System.IO.EndOfStreamException("the server closed the connection");
                got += count;
            }
        }

        void Keep(ulong poseStamp, byte[] body)
        {
            int count = (int)Get(body, 2, 2);
            if (body[0] != Float32 || body[1] != 1 || body.Length != 4 + 4 * count) return;
            float[] values = new float[count];
            for (int i = 0; i < count; ++i) values[i] = GetFloat(body, 4 + 4 * i);
            lock (guard)
            {
                newest = values;
                stamp = poseStamp;
            }
        }

        static string Name(byte[] bytes, int at, int size)
        {
            return Encoding.ASCII.GetString(bytes, at, size).TrimEnd('\0');
        }

        static ulong Get(byte[] bytes, int at, int size)
        {
            ulong value = 0;
            for (int i = 0; i < size; ++i) value = value << 8 | bytes[at + i];
            return value;
        }

        static void Put(byte[] bytes, int at, int size, ulong value)
        {
            for (int i = size - 1; i >= 0; --i, value >>= 8) bytes[at + i] = (byte)value;
        }

        static float GetFloat(byte[] bytes, int at)
        {
            return BitConverter.ToSingle(BitConverter.GetBytes((uint)Get(bytes, at, 4)), 0);
        }

        static void PutFloat(byte[] bytes, int at, float value)
        {
            Put(bytes, at, 4, BitConverter.ToUInt32(BitConverter.GetBytes(value), 0));
        }

        static ulong[] MakeTable()
        {
            ulong[] table = new ulong[256];
            for (ulong b = 0; b < 256; ++b)
            {
                ulong value = b << 56;
                for (int bit = 0; bit < 8; ++bit)
                    value = value << 1 ^ (value >> 63 != 0 ? 0x42F0E1EBA9EA3693UL : 0UL);
                table[b] = value;
            }
            return table;
        }

        static ulong Crc(byte[] bytes)
        {
            ulong crc = 0;
            foreach (byte b in bytes) crc = crc << 8 ^ Table[crc >> 56 ^ b];
            return crc;
        }
    }

    /// <summary>A basis file, read by libsupine_runtime on little-endian 64-bit machines.</summary>
    public sealed class Basis : IDisposable
    {
        const string Library = "supine_runtime";
        [DllImport(Library)] static extern int supine_basis_open(string path, out IntPtr basis, IntPtr error);
        [DllImport(Library)] static extern void supine_basis_close(IntPtr basis);
        [DllImport(Library)] static extern IntPtr supine_basis_get_info(IntPtr basis);
        [DllImport(Library)] static extern IntPtr supine_basis_vertices(IntPtr basis);
        [DllImport(Library)] static extern IntPtr supine_basis_triangles(IntPtr basis);
        [DllImport(Library)] static extern IntPtr supine_basis_tensor(IntPtr basis, string name);
        [DllImport(Library)] static extern int supine_state_parse(string text, byte[] state, byte[] error);
        [DllImport(Library)] static extern int supine_state_parse_volume(string text, byte[] state, byte[] error);
        [DllImport(Library)] static extern int supine_posture_rotation(
            double[] rotation, UIntPtr count, double[] up, string axes, double[] gravity, byte[] error);
        [DllImport(Library)] static extern int supine_basis_pose(IntPtr b, byte[] state, double[] pose, byte[] error);
        [DllImport(Library)] static extern int supine_deform_lit(IntPtr b, double[] pose, float[] xyz, float[] n);

        [StructLayout(LayoutKind.Sequential)]
        struct Info // the beginning of supine_basis_info
        {
            public UIntPtr Vertices, Triangles, Modes, Band, Lungs;
        }

        [StructLayout(LayoutKind.Sequential)]
        struct Tensor // supine_tensor
        {
            public IntPtr Name;
            public int Type;
            public UIntPtr Rank, Rows, Columns, Depth, Last;
            public IntPtr Data;
        }

        const int StateSize = 112, ErrorSize = 688; // sizeof(supine_state), sizeof(supine_error)
        const int ModesMax = 256, LungsMax = 16;
        IntPtr handle;
        readonly int weights, lungs; // number of weights: one of each mode or, in fields over volume, of each lung and mode
        readonly byte[] state = new byte[StateSize], error = new byte[ErrorSize];
        readonly double[] pose = new double[ModesMax + 4 * LungsMax + 1]; // supine_pose: weights, gains, basis, expansions

        public Basis(string path)
        {
            int status = supine_basis_open(path, out handle, IntPtr.Zero);
            if (status != 0) throw new ArgumentException(path + ": not a readable basis file (status " + status + ")");
            Info info = (Info)Marshal.PtrToStructure(supine_basis_get_info(handle), typeof(Info));
            VertexCount = (int)info.Vertices;
            TriangleCount = (int)info.Triangles;
            lungs = (int)info.Lungs;
            Tensor modes = (Tensor)Marshal.PtrToStructure(supine_basis_tensor(handle, "modes"), typeof(Tensor));
            weights = (int)info.Modes * ((int)modes.Depth > 1 ? lungs : 1);
        }

        public int VertexCount { get; private set; }
        public int TriangleCount { get; private set; }

        /// <summary>Computes gravity in body axes, as supine_posture_rotation does.</summary>
        public double[] Gravity(double[] rotation, double[] up, string axes)
        {
            double[] gravity = new double[3];
            Check(supine_posture_rotation(rotation, (UIntPtr)rotation.Length, up, axes, gravity, error));
            return gravity;
        }

        /// <summary>Poses the lungs for gravity in body axes and a volume such as "rest+500".</summary>
        public void Pose(double[] gravity, string volume)
        {
            Array.Clear(state, 0, StateSize);
            Buffer.BlockCopy(gravity, 0, state, 0, 3 * sizeof(double)); // the first member of a supine_state
            Check(supine_state_parse_volume(volume, state, error));
            Check(supine_basis_pose(handle, state, pose, error));
        }

        /// <summary>Poses the lungs as a received frame says.</summary>
        public void Pose(float[] frame)
        {
            if (frame.Length != weights + 3 * lungs)
                throw new ArgumentException("the frame belongs to another basis: open the basis file of the server");
            for (int i = 0; i < frame.Length; ++i) pose[PoseIndex(i)] = frame[i];
        }

        /// <summary>Computes positions, mm, and unit normals of the vertices in the pose, both [3 N], LPS.</summary>
        public void Deform(float[] xyz, float[] normals)
        {
            if (xyz.Length != 3 * VertexCount || normals.Length != 3 * VertexCount)
                throw new ArgumentException("give arrays of " + 3 * VertexCount + " numbers");
            if (supine_deform_lit(handle, pose, xyz, normals) != 0)
                throw new ArgumentException("the pose is of another basis");
        }

        /// <summary>Computes a frame, as the server would send it, from a state such as "left:rest+500".</summary>
        public float[] Frame(string text)
        {
            Array.Clear(state, 0, StateSize);
            Check(supine_state_parse(text, state, error));
            Check(supine_basis_pose(handle, state, pose, error));
            float[] frame = new float[weights + 3 * lungs];
            for (int i = 0; i < frame.Length; ++i) frame[i] = (float)pose[PoseIndex(i)];
            return frame;
        }

        // Throws the message of the library, which follows its status, if there is one.
        void Check(int status)
        {
            if (status != 0) throw new ArgumentException(Encoding.UTF8.GetString(error, 4, 512).Split('\0')[0]);
        }

        // Returns the index in `pose` of the i-th number of a frame.
        int PoseIndex(int i)
        {
            return i < weights ? i : ModesMax + i - weights;
        }

        public float[] Vertices()
        {
            float[] xyz = new float[3 * VertexCount];
            Marshal.Copy(supine_basis_vertices(handle), xyz, 0, xyz.Length);
            return xyz;
        }

        public int[] Triangles()
        {
            int[] corners = new int[3 * TriangleCount];
            Marshal.Copy(supine_basis_triangles(handle), corners, 0, corners.Length);
            return corners;
        }

        public void Dispose()
        {
            supine_basis_close(handle);
            handle = IntPtr.Zero;
        }
    }
}
