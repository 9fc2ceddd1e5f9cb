// SPDX-License-Identifier: MIT
// Deform the lungs of a basis file to one state, and write the positions, float [3 N], mm, LPS:
//
//     mono Deform.exe lungs.safetensors prone:rest+500 positions.bin
using System;
using System.IO;
using System.Runtime.InteropServices;
using System.Text;

static class Deform
{
    const string Library = "supine_runtime";
    const int StateSize = 112;                  // sizeof(supine_state)
    const int PoseSize = 256 + 16 * 3 + 1 + 16; // supine_pose in doubles: weights, gains, identity, expansions

    [StructLayout(LayoutKind.Sequential)]
    struct SupineError
    {
        public int status;
        [MarshalAs(UnmanagedType.ByValArray, SizeConst = 512)] public byte[] message;
        [MarshalAs(UnmanagedType.ByValArray, SizeConst = 172)] public byte[] remedies; // which this program does not use
    }

    [DllImport(Library)] static extern int supine_basis_open([MarshalAs(UnmanagedType.LPUTF8Str)] string path,
                                                             out IntPtr basis, ref SupineError error);
    [DllImport(Library)] static extern void supine_basis_close(IntPtr basis);
    // The first member of the struct that this returns is the number of vertices, a size_t.
    [DllImport(Library)] static extern IntPtr supine_basis_get_info(IntPtr basis);
    [DllImport(Library)] static extern int supine_state_parse([MarshalAs(UnmanagedType.LPUTF8Str)] string text,
                                                              byte[] state, ref SupineError error);
    [DllImport(Library)] static extern int supine_basis_pose(IntPtr basis, byte[] state, [Out] double[] pose,
                                                             ref SupineError error);
    [DllImport(Library)] static extern int supine_deform(IntPtr basis, double[] pose, [Out] float[] xyz);

    static void Check(int status, SupineError error)
    {
        if (status != 0) throw new ArgumentException(Encoding.UTF8.GetString(error.message).Split('\0')[0]);
    }

    static float[] Positions(IntPtr basis, string text)
    {
        SupineError error = new SupineError();
        byte[] state = new byte[StateSize]; // zeros before the first use
        double[] pose = new double[PoseSize];
        float[] xyz = new float[3 * (int)Marshal.ReadIntPtr(supine_basis_get_info(basis))];
        Check(supine_state_parse(text, state, ref error), error);
        Check(supine_basis_pose(basis, state, pose, ref error), error); // once per frame
        Check(supine_deform(basis, pose, xyz), error);                  // all vertices
        return xyz;
    }

    static int Main(string[] arguments)
    {
        if (arguments.Length != 3)
        {
            Console.Error.WriteLine("usage: Deform BASIS STATE OUTPUT");
            return 1;
        }
        SupineError error = new SupineError();
        IntPtr basis = IntPtr.Zero;
        try
        {
            Check(supine_basis_open(arguments[0], out basis, ref error), error);
            float[] xyz = Positions(basis, arguments[1]);
            byte[] bytes = new byte[sizeof(float) * xyz.Length];
            Buffer.BlockCopy(xyz, 0, bytes, 0, bytes.Length);
            File.WriteAllBytes(arguments[2], bytes);
            Console.WriteLine("{0} vertices written to {1}", xyz.Length / 3, arguments[2]);
            return 0;
        }
        catch (ArgumentException failure)
        {
            Console.Error.WriteLine(failure.Message);
            return 2;
        }
        finally
        {
            supine_basis_close(basis);
        }
    }
}
