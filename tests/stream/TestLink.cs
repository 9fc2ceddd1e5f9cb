// SPDX-License-Identifier: GPL-3.0-or-later
// Test the link of the Unity example with a real server: TestLink.exe PORT BASIS
using System;
using System.Diagnostics;
using System.Reflection;
using System.Threading;
using Supine;
using UnityEngine;

static class TestLink
{
    static void Expect(bool holds, string what)
    {
        if (holds) return;
        Console.Error.WriteLine("failed: " + what);
        Environment.Exit(1);
    }

    static float Far(float[] a, float[] b)
    {
        Expect(a.Length == b.Length, "equal numbers of values");
        float most = 0;
        for (int i = 0; i < a.Length; ++i) most = Math.Max(most, Math.Abs(a[i] - b[i]));
        Expect(!float.IsNaN(most), "values are numbers");
        return most;
    }

    // Return six times the enclosed volume, positive if triangles face outwards in these axes.
    static double Volume(float[] p, int[] t)
    {
        double sum = 0;
        for (int i = 0; i < t.Length; i += 3)
        {
            int a = 3 * t[i], b = 3 * t[i + 1], c = 3 * t[i + 2];
            sum += p[a] * ((double)p[b + 1] * p[c + 2] - (double)p[b + 2] * p[c + 1])
                 + p[a + 1] * ((double)p[b + 2] * p[c] - (double)p[b] * p[c + 2])
                 + p[a + 2] * ((double)p[b] * p[c + 1] - (double)p[b + 1] * p[c]);
        }
        return sum;
    }

    static float[] Answer(Link link, ulong wanted)
    {
        Stopwatch clock = Stopwatch.StartNew();
        while (clock.ElapsedMilliseconds < 100000)
        {
            ulong stamp;
            float[] frame = link.TakeNewest(out stamp);
            if (frame != null && stamp == wanted) return frame;
            Expect(link.Failure == null, "the connection is open: " + link.Failure);
            Thread.Sleep(1);
        }
        Expect(false, "an answer arrives");
        return null;
    }

    static float[] ToUnity(float[] xyz)
    {
        Vector3[] points = new Vector3[xyz.Length / 3];
        for (int i = 0; i < points.Length; ++i)
            points[i] = LungBehaviour.ToUnity(xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2], 1e-3f);
        return Points(points);
    }

    static float[] Points(Vector3[] points)
    {
        float[] numbers = new float[3 * points.Length];
        for (int i = 0; i < points.Length; ++i)
            new float[] { points[i].x, points[i].y, points[i].z }.CopyTo(numbers, 3 * i);
        return numbers;
    }

    static void Call(LungBehaviour lungs, string name)
    {
        typeof(LungBehaviour).GetMethod(name, BindingFlags.Instance | BindingFlags.NonPublic).Invoke(lungs, null);
    }

    // Run the script in an object with a rotation, without a server, and return the vertices of its mesh. A triangle's
    // normal and the normals of its corners point to the same side.
    static Vector3[] Behave(string path, Quaternion rotation)
    {
        LungBehaviour lungs = new LungBehaviour { basisFile = path, volume = "rest+400" };
        lungs.transform.rotation = rotation;
        foreach (string name in new string[] { "Start", "Update" }) Call(lungs, name);
        Mesh mesh = lungs.GetComponent<MeshFilter>().mesh;
        int agree = 0;
        for (int i = 0; i < mesh.triangles.Length; i += 3)
        {
            Vector3 a = mesh.vertices[mesh.triangles[i]], n = mesh.normals[mesh.triangles[i]];
            Vector3 b = mesh.vertices[mesh.triangles[i + 1]], c = mesh.vertices[mesh.triangles[i + 2]];
            float ux = b.x - a.x, uy = b.y - a.y, uz = b.z - a.z, vx = c.x - a.x, vy = c.y - a.y, vz = c.z - a.z;
            float side = n.x * (uy * vz - uz * vy) + n.y * (uz * vx - ux * vz) + n.z * (ux * vy - uy * vx);
            Expect(Math.Abs(n.x * n.x + n.y * n.y + n.z * n.z - 1) < 0.02, "normals have the length 1");
            if (side > 0) ++agree;
        }
        Expect(agree > 0.98 * mesh.triangles.Length / 3, "normals point outwards");
        Call(lungs, "OnDestroy");
        return mesh.vertices;
    }

    static void ExpectRefused(Basis basis)
    {
        double[] up = { 0, 1, 0 };
        double[][] bad = { new double[] { 1, 1, 0, 0 }, new double[] { double.NaN, 0, 0, 0 },
                           new double[] { -1, 0, 0, 0, 1, 0, 0, 0, 1 } };
        foreach (double[] rotation in bad)
        {
            string message = "";
            try { basis.Gravity(rotation, up, "unity"); }
            catch (ArgumentException failure) { message = failure.Message; }
            Expect(message.StartsWith("not a rotation: scale"), "refused: " + message);
        }
    }

    static int Main(string[] words)
    {
        // Rotation matrices of `postures`, by rows. The columns are the directions of left, back and head in a room with z up.
        float[][] rotations = {
            new float[] { 1, 0, 0, 0, 0, 1, 0, -1, 0 },
            new float[] { -1, 0, 0, 0, 0, 1, 0, 1, 0 },
            new float[] { 0, -1, 0, 0, 0, 1, -1, 0, 0 },
            new float[] { 0, 1, 0, 0, 0, 1, 1, 0, 0 } };
        // Rotations that bring a standing Unity object into each of `postures`: 90 degrees about x or z; h = sin 45 = cos 45 degrees.
        const float h = 0.70710678f;
        Quaternion[] turns = { new Quaternion(-h, 0, 0, h), new Quaternion(h, 0, 0, h),
                               new Quaternion(0, 0, h, h), new Quaternion(0, 0, -h, h) };
        string[] postures = { "supine", "prone", "left", "right" };
        using (Basis basis = new Basis(words[1]))
        using (Link link = new Link("127.0.0.1", int.Parse(words[0])))
        {
            float[] rest = basis.Vertices();
            float[] xyz = new float[rest.Length];
            float[] before = new float[rest.Length];
            float[] normals = new float[rest.Length];
            for (int i = 0; i < 4; ++i)
            {
                link.SendPose("Patient", LungBehaviour.Pose(turns[i]), (ulong)(90 + i));
                float[] turned = Answer(link, (ulong)(90 + i));
                link.SendPose("Patient", rotations[i], (ulong)(100 + i));
                float[] frame = Answer(link, (ulong)(100 + i));
                Expect(Far(turned, frame) < 1e-4f, "an object rotated to a posture gets the weights of the posture");
                Expect(Far(frame, basis.Frame(postures[i] + ":rest+400")) < 1e-4f, "weights and gains of the posture");
                basis.Pose(frame);
                basis.Deform(xyz, normals);
                Expect(Far(xyz, rest) > 1, "the lung moves");
                Expect(i == 0 || Far(xyz, before) > 0.5f, "shapes differ between postures");
                xyz.CopyTo(before, 0);
                Expect(Far(Points(Behave(words[1], turns[i])), ToUnity(xyz)) < 1e-6f,
                       "without a server, an object rotated to a posture has the positions of the posture");
            }
            link.SetVolume("full");
            link.SendPose("Patient", rotations[0], 200);
            basis.Pose(Answer(link, 200));
            basis.Deform(xyz, normals);
            Expect(Far(xyz, rest) < 0.02f, "at full inflation the surface is that of the file");
            Expect(basis.Triangles().Length == 3 * basis.TriangleCount, "triangles");
            Expect(Volume(rest, basis.Triangles()) > 0, "triangles face outwards in right-handed axes");
            Expect(Volume(ToUnity(rest), LungBehaviour.ToUnity(basis.Triangles())) > 0, "triangles are clockwise from outside in left-handed axes");
            ExpectRefused(basis);
        }
        return 0;
    }
}
