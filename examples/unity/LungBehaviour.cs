// SPDX-License-Identifier: MIT
// Shows the lungs in a Unity scene. Add this script to an object with a MeshFilter, and set the basis file
// and the server of 'supine stream'. The object is the patient: its rotation is sent to the server whenever
// it changes. Unity's axes are left-handed, in metres, y up. An object without rotation is a standing
// patient who faces +z, with left, back and head at -x, -z and +y.
using UnityEngine;
using UnityEngine.Rendering;

public class LungBehaviour : MonoBehaviour
{
    public string basisFile = "lungs.safetensors";
    public string host = "localhost";
    public int port = 18944;
    Supine.Basis basis;
    Supine.Link link;
    float[] xyz;
    Vector3[] positions;
    Mesh mesh;
    ulong sent;

    public static Vector3 ToUnity(float left, float back, float head)
    {
        return new Vector3(-1e-3f * left, 1e-3f * head, -1e-3f * back);
    }

    /// <summary>Reverses triangles in place, so that they face outwards in left-handed axes.</summary>
    public static int[] ToUnity(int[] corners)
    {
        for (int i = 0; i < corners.Length; i += 3)
        {
            int second = corners[i + 1];
            corners[i + 1] = corners[i + 2];
            corners[i + 2] = second;
        }
        return corners;
    }

    /// <summary>Converts a rotation to the row-major matrix from body axes (LPS) to world axes, z up.</summary>
    public static float[] Pose(Quaternion rotation)
    {
        Vector3[] axes = { rotation * new Vector3(-1, 0, 0), rotation * new Vector3(0, 0, -1),
                           rotation * new Vector3(0, 1, 0) };
        float[] rows = new float[9];
        for (int column = 0; column < 3; ++column)
        {
            rows[column] = -axes[column].x;
            rows[3 + column] = -axes[column].z;
            rows[6 + column] = axes[column].y;
        }
        return rows;
    }

    void Start()
    {
        basis = new Supine.Basis(basisFile);
        link = new Supine.Link(host, port);
        xyz = basis.Vertices();
        positions = new Vector3[basis.VertexCount];
        mesh = new Mesh();
        mesh.indexFormat = IndexFormat.UInt32;
        mesh.MarkDynamic();
        Show();
        mesh.triangles = ToUnity(basis.Triangles());
        mesh.RecalculateNormals();
        GetComponent<MeshFilter>().mesh = mesh;
    }

    void Update()
    {
        if (transform.hasChanged)
        {
            link.SendPose("Patient", Pose(transform.rotation), ++sent);
            transform.hasChanged = false;
        }
        ulong stamp;
        float[] frame = link.TakeNewest(out stamp);
        if (frame == null) return;
        basis.Deform(frame, xyz);
        Show();
        mesh.RecalculateNormals();
    }

    void Show()
    {
        for (int i = 0; i < positions.Length; ++i)
            positions[i] = ToUnity(xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2]);
        mesh.vertices = positions;
    }

    void OnDestroy()
    {
        if (link != null) link.Dispose();
        if (basis != null) basis.Dispose();
    }
}
